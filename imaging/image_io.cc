#include "imaging/image_io.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <exception>
#include <memory>
#include <new>
#include <regex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/files/input_file.h"
#include "imaging/color.h"
#include "imaging/file_check.h"

namespace sateen {
namespace {

// A decoded file: fractions of full scale for integers, after the transfer function if asked.
struct Decoded {
  Image3 rgb;
  int channels = 0;  // as stored
  bool is_float = false;
  bool was_srgb = false;
};

std::string LowerEnding(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

// The plugin follows from the content: by name alone OpenImageIO tries every plugin on a misnamed
// file, its RAW and video readers included. TGA has no mark to know it by.
const char* FormatOf(const std::filesystem::path& path, const std::string& head) {
  if (head.starts_with("\x89PNG")) {
    return "png";
  }
  if (head.starts_with("\xFF\xD8\xFF")) {
    return "jpeg";
  }
  if (head.starts_with("\x76\x2F\x31\x01")) {
    return "openexr";
  }
  if (IsTiffHead(head) || head.starts_with(std::string("II+\0", 4)) ||
      head.starts_with(std::string("MM\0+", 4))) {
    return "tiff";
  }
  return LowerEnding(path) == ".tga" ? "targa" : nullptr;
}

tl::unexpected<Error> Undecodable(const std::filesystem::path& path, std::string reason) {
  static const std::regex library_name("/proc/self/fd/[0-9]+");  // InputFile::LibraryName()
  reason = std::regex_replace(reason, library_name, "it");
  while (!reason.empty() && std::isspace(static_cast<unsigned char>(reason.back())) != 0) {
    reason.pop_back();
  }
  std::replace(reason.begin(), reason.end(), '\n', ' ');
  return Fail(ErrorCode::kBadData,
              "{}: cannot be decoded, it is damaged or cut short ({}); copy or export it again",
              path.string(), reason);
}

Status CheckSpec(const std::filesystem::path& path, std::string_view format,
                 const OIIO::ImageSpec& spec) {
  if (spec.depth != 1) {
    return Fail(ErrorCode::kBadData, "{}: has {} slices; need a flat picture", path.string(),
                spec.depth);
  }
  if (spec.deep || spec.nchannels < 1 || spec.nchannels > 4) {
    return Fail(ErrorCode::kBadData, "{}: has {} {}channels; needed are 1 to 4 flat ones",
                path.string(), spec.nchannels, spec.deep ? "deep " : "");
  }
  const bool windows_agree = spec.x == spec.full_x && spec.y == spec.full_y &&
                             spec.width == spec.full_width && spec.height == spec.full_height;
  if (format == "openexr" && !windows_agree) {
    return Fail(ErrorCode::kBadData,
                "{}: its data window {}x{}+{}+{} is not its display window {}x{}+{}+{}; save it "
                "uncropped",
                path.string(), spec.width, spec.height, spec.x, spec.y, spec.full_width,
                spec.full_height, spec.full_x, spec.full_y);
  }
  return {};
}

// The first `colours` channels as stored. Half and double come as float.
template <typename T>
Result<std::vector<T>> ReadSamples(const std::filesystem::path& path, OIIO::ImageInput& input,
                                   int colours) {
  const OIIO::ImageSpec& spec = input.spec();
  std::vector<T> samples(static_cast<size_t>(spec.image_pixels()) * static_cast<size_t>(colours));
  const bool complete = input.read_image(/*subimage=*/0, /*miplevel=*/0, /*chbegin=*/0, colours,
                                         OIIO::BaseTypeFromC<T>::value, samples.data());
  // If a JPEG or an uncompressed TIFF is cut short, only the error text tells: the call succeeds
  // and the rest is grey.
  if (!complete || input.has_error()) {
    const std::string reason = input.geterror();
    if (reason.find("bad_alloc") != std::string::npos) {  // OpenImageIO turns it into words
      throw std::bad_alloc();
    }
    return Undecodable(path, reason);
  }
  return samples;
}

template <typename T, typename ToFloat>
Image3 Planes(ImageSize size, const std::vector<T>& samples, int colours, ToFloat to_float) {
  Image3 image(size);
  const size_t stride = static_cast<size_t>(colours);
  for (size_t c = 0; c < 3; ++c) {
    const size_t channel = std::min(c, stride - 1);
    std::vector<float>& plane = image[c].pixels;
    for (size_t p = 0; p < plane.size(); ++p) {
      plane[p] = to_float(samples[p * stride + channel]);
    }
  }
  return image;
}

template <typename T>
Result<Image3> ReadInteger(const std::filesystem::path& path, OIIO::ImageInput& input, int colours,
                           bool is_srgb) {
  const Result<std::vector<T>> samples = ReadSamples<T>(path, input, colours);
  if (!samples) {
    return tl::unexpected(samples.error());
  }
  constexpr size_t kFullScale = std::numeric_limits<T>::max();
  std::vector<float> linear(kFullScale + 1);
  for (size_t i = 0; i <= kFullScale; ++i) {
    const float value = static_cast<float>(i) / static_cast<float>(kFullScale);
    linear[i] = is_srgb ? LinearFromSrgb(value) : value;
  }
  return Planes(ImageSize{input.spec().width, input.spec().height}, *samples, colours,
                [&linear](T sample) { return linear[sample]; });
}

Result<Image3> ReadFloat(const std::filesystem::path& path, OIIO::ImageInput& input, int colours) {
  const Result<std::vector<float>> samples = ReadSamples<float>(path, input, colours);
  if (!samples) {
    return tl::unexpected(samples.error());
  }
  return Planes(ImageSize{input.spec().width, input.spec().height}, *samples, colours,
                [](float sample) { return sample; });
}

bool IsFloat(const OIIO::ImageSpec& spec, int colours) {
  for (int c = 0; c < colours; ++c) {
    const OIIO::TypeDesc type = spec.channelformat(c);
    if (type != OIIO::TypeHalf && type != OIIO::TypeFloat && type != OIIO::TypeDesc::DOUBLE) {
      return false;
    }
  }
  return true;
}

Result<Decoded> DecodeOpened(const std::filesystem::path& path, OIIO::ImageInput& input,
                             Encoding encoding) {
  const OIIO::ImageSpec& spec = input.spec();
  const int colours = spec.nchannels < 3 ? 1 : 3;
  Decoded decoded;
  decoded.channels = spec.nchannels;
  Result<Image3> rgb;
  if (spec.format == OIIO::TypeUInt8) {
    decoded.was_srgb = encoding != Encoding::kLinear;
    rgb = ReadInteger<uint8_t>(path, input, colours, decoded.was_srgb);
  } else if (spec.format == OIIO::TypeUInt16) {
    decoded.was_srgb = encoding == Encoding::kSrgb;
    rgb = ReadInteger<uint16_t>(path, input, colours, decoded.was_srgb);
  } else if (IsFloat(spec, colours)) {
    decoded.is_float = true;
    rgb = ReadFloat(path, input, colours);
  } else {
    return Fail(ErrorCode::kBadData,
                "{}: has {} samples; needed are 8 or 16-bit unsigned integers or floats",
                path.string(), spec.format.c_str());
  }
  if (!rgb) {
    return tl::unexpected(rgb.error());
  }
  decoded.rgb = std::move(*rgb);
  return decoded;
}

// A file whose header is read and allowed.
struct OpenedPhoto {
  InputFile file;  // as long as `input` reads it
  std::unique_ptr<OIIO::ImageInput> input;
};

Result<OpenedPhoto> OpenPhotoUnguarded(const std::filesystem::path& path,
                                       const PictureLimit& limit) {
  Result<InputFile> file = InputFile::Open(path);
  if (!file) {
    return tl::unexpected(file.error());
  }
  const Result<std::string> head = ReadHead(*file);
  if (!head) {
    return tl::unexpected(head.error());
  }
  const char* format = FormatOf(path, *head);
  if (format == nullptr) {
    return Fail(ErrorCode::kBadData, "{}: is not an EXR, PNG, TIFF, TGA or JPEG file",
                path.string());
  }
  if (std::string_view(format) == "png") {
    if (const Status whole = CheckPngIsWhole(*file); !whole) {
      return tl::unexpected(whole.error());
    }
  }
  OpenedPhoto opened{*std::move(file), OIIO::ImageInput::create(format)};
  if (!opened.input) {
    return Fail(ErrorCode::kBadData, "{}: this OpenImageIO cannot read {} files: {}", path.string(),
                format, OIIO::geterror());
  }
  OIIO::ImageSpec as_stored;
  as_stored.attribute("oiio:UnassociatedAlpha", 1);
  OIIO::ImageSpec ignored;
  if (!opened.input->open(opened.file.LibraryName(), ignored, as_stored)) {
    return Undecodable(path, opened.input->geterror());
  }
  const OIIO::ImageSpec& spec = opened.input->spec();
  if (const Status allowed =
          limit.Check(path, {spec.width, spec.height}, opened.file.Bytes()).and_then([&] {
            return CheckSpec(path, format, spec);
          });
      !allowed) {
    return tl::unexpected(allowed.error());
  }
  return opened;
}

Result<OpenedPhoto> OpenPhoto(const std::filesystem::path& path, const PictureLimit& limit) {
  try {
    return OpenPhotoUnguarded(path, limit);
  } catch (const std::bad_alloc&) {
    return Fail(ErrorCode::kOutOfMemory, "{}: out of memory while its header was read",
                path.string());
  } catch (const std::exception& error) {
    return Undecodable(path, error.what());
  }
}

Result<Decoded> Decode(const std::filesystem::path& path, Encoding encoding,
                       const PictureLimit& limit) {
  Result<OpenedPhoto> opened = OpenPhoto(path, limit);
  if (!opened) {
    return tl::unexpected(opened.error());
  }
  try {
    return DecodeOpened(path, *opened->input, encoding);
  } catch (const std::bad_alloc&) {
    const OIIO::ImageSpec& spec = opened->input->spec();
    return OutOfMemory(path, {spec.width, spec.height}, spec.image_bytes(true));
  } catch (const std::exception& error) {
    return Undecodable(path, error.what());
  }
}

}  // namespace

Result<Photo> ReadPhoto(const std::filesystem::path& path, Encoding encoding,
                        const PictureLimit& limit) {
  Result<Decoded> decoded = Decode(path, encoding, limit);
  if (!decoded) {
    return tl::unexpected(decoded.error());
  }
  Photo photo;
  photo.rgb = std::move(decoded->rgb);
  photo.was_srgb = decoded->was_srgb;
  if (!decoded->is_float) {
    photo.saturation = 1.0F;
  }
  return photo;
}

Result<ImageSize> ReadPhotoSize(const std::filesystem::path& path, const PictureLimit& limit) {
  return OpenPhoto(path, limit).map([](const OpenedPhoto& opened) {
    return ImageSize{opened.input->spec().width, opened.input->spec().height};
  });
}

Result<Image3> ReadImage3(const std::filesystem::path& path, const PictureLimit& limit) {
  Result<Decoded> decoded = Decode(path, Encoding::kLinear, limit);
  if (!decoded) {
    return tl::unexpected(decoded.error());
  }
  if (decoded->channels < 3) {
    return Fail(ErrorCode::kBadData, "{}: has {} channel(s); needed are three (x, y, z or RGB)",
                path.string(), decoded->channels);
  }
  return std::move(decoded->rgb);
}

Result<Mask> ReadMask(const std::filesystem::path& path, const PictureLimit& limit) {
  const Result<Decoded> decoded = Decode(path, Encoding::kLinear, limit);
  if (!decoded) {
    return tl::unexpected(decoded.error());
  }
  Mask mask(decoded->rgb.Size());
  for (size_t p = 0; p < mask.pixels.size(); ++p) {
    const bool inside = std::ranges::any_of(
        decoded->rgb.planes, [p](const Image<float>& plane) { return plane.pixels[p] >= 0.5F; });
    mask.pixels[p] = inside ? 255 : 0;
  }
  return mask;
}

bool IsPhotoName(const std::filesystem::path& path) {
  constexpr std::array<std::string_view, 7> kEndings = {".exr", ".png", ".tif", ".tiff",
                                                        ".tga", ".jpg", ".jpeg"};
  return std::ranges::find(kEndings, LowerEnding(path)) != kEndings.end();
}

}  // namespace sateen
