// Any bytes go for a picture and for a camera RAW file. What is read has the pixels that it says.
#include "fuzz/target.h"
#include "imaging/file_check.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"

namespace sateen::fuzz {

void Try(std::string_view bytes) {
  // The name of the one kind that is not known by its content.
  const std::filesystem::path path = FileOf("picture.tga", bytes);
  if (const auto file = InputFile::Open(path)) {
    static_cast<void>(CheckTiffIsWhole(*file));
  }
  const auto photo = ReadPhoto(path);
  Need(photo || photo.error().code != ErrorCode::kOutOfMemory);
  if (photo) {
    const ImageSize read = photo->rgb.Size();
    Need(read.width > 0 && read.height > 0);
    for (const Image<float>& plane : photo->rgb.planes) {
      Need(plane.Size() == read && plane.pixels.size() == read.PixelCount());
    }
  }
  const auto mosaic = ReadRawMosaic(path);
  Need(mosaic || mosaic.error().code != ErrorCode::kOutOfMemory);
  if (mosaic) {
    Need(mosaic->samples.width >= 2 && mosaic->samples.height >= 2 &&
         mosaic->black < mosaic->white);
    Need(Demosaic(*mosaic).Size() == mosaic->samples.Size());
  }
}

}  // namespace sateen::fuzz
