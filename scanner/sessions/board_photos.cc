#include "scanner/sessions/board_photos.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "core/sha256.h"
#include "core/statistics.h"
#include "imaging/color.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/frames/frame_loader.h"
#include "scanner/sessions/session.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr double kWhitePercentile = 0.995;

bool IsPicture(const std::string& name) { return IsPhotoName(name) || IsRawName(name); }

Result<BoardPhoto> PhotoOfSession(const fs::path& dir, const std::string& name,
                                  BoardFolder& folder) {
  const Result<Session> session = ReadSession(dir);
  if (!session) {
    return tl::unexpected(session.error());
  }
  if (session->kind != SessionKind::kBoard) {
    return Fail(ErrorCode::kBadData, "{}: is a session of kind '{}'; need a board", dir.string(),
                Name(session->kind));
  }
  BoardPhoto photo{.name = name, .files = {}};
  for (const SessionFrame& frame : session->frames) {
    if (frame.role == FrameRole::kLit) {
      photo.files.push_back({dir / frame.file, frame.Exposure(), frame.sha256});
    }
  }
  if (photo.files.empty()) {
    return Fail(ErrorCode::kBadData, "{}: the session has no lit frame; need one of the board",
                dir.string());
  }
  const fs::path record = dir / "session.json";
  const Result<std::string> hash = Sha256OfFile(record);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  folder.sha256_of_input[record.string()] = *hash;
  return photo;
}

Result<std::vector<std::string>> FoldersIn(const fs::path& dir) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(dir, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    std::error_code ignored;
    const std::string name = entry->path().filename().string();
    if (!name.starts_with('.') && entry->is_directory(ignored)) {
      names.push_back(name);
    }
  }
  if (error) {
    return Fail(ErrorCode::kIo, "{}: the folder cannot be listed: {}", dir.string(),
                error.message());
  }
  return names;
}

// Linear light of one file, exposure divided out, or the grey levels of an 8-bit file.
struct GreyLight {
  Image<float> grey;
  bool is_coded = false;  // 8 bits: grey levels
};

Image<float> GreyOf(const Image3& rgb, float scale) {
  Image<float> grey(rgb.Size());
  for (size_t p = 0; p < grey.pixels.size(); ++p) {
    grey.pixels[p] = scale * (kLuminance[0] * rgb[0].pixels[p] + kLuminance[1] * rgb[1].pixels[p] +
                              kLuminance[2] * rgb[2].pixels[p]);
  }
  return grey;
}

Result<GreyLight> ReadLight(const FrameFile& file) {
  const auto per_exposure = static_cast<float>(1.0 / file.exposure);
  if (IsRawName(file.path)) {
    return ReadRawMosaic(file.path, file.limit).map([&](const RawMosaic& mosaic) {
      return GreyLight{GreyOf(Demosaic(mosaic, mosaic.camera_white_balance), per_exposure)};
    });
  }
  const Result<Photo> photo = ReadPhoto(file.path, Encoding::kAuto, file.limit);
  if (!photo) {
    return tl::unexpected(photo.error());
  }
  GreyLight light{GreyOf(photo->rgb, photo->was_srgb ? 1.0F : per_exposure), photo->was_srgb};
  if (light.is_coded) {
    for (float& value : light.grey.pixels) {
      value = SrgbFromLinear(value);
    }
  }
  return light;
}

float WhiteLevel(const Image<float>& linear) {
  std::vector<float> values;
  values.reserve(linear.pixels.size());
  std::copy_if(linear.pixels.begin(), linear.pixels.end(), std::back_inserter(values),
               [](float value) { return std::isfinite(value); });
  if (values.empty()) {
    return 0.0F;
  }
  return Quantile(std::move(values), kWhitePercentile);
}

Image<uint8_t> BytesOf(const Image<float>& levels) {
  Image<uint8_t> bytes(levels.Size());
  std::transform(levels.pixels.begin(), levels.pixels.end(), bytes.pixels.begin(), [](float level) {
    return std::isfinite(level)
               ? static_cast<uint8_t>(std::lround(255.0F * std::clamp(level, 0.0F, 1.0F)))
               : uint8_t{0};
  });
  return bytes;
}

}  // namespace

Result<BoardFolder> ListBoardPhotos(const fs::path& path) {
  BoardFolder folder;
  std::error_code error;
  if (!fs::exists(path, error)) {
    return Fail(ErrorCode::kIo, "{}: does not exist; need photographs of a board", path.string());
  }
  if (!fs::is_directory(path, error)) {
    folder.photos.push_back({path.filename().string(), {FrameFile{path, 1.0, std::nullopt}}});
    return folder;
  }
  if (Exists(path / "session.json") || Exists(path / "journal.jsonl")) {
    Result<BoardPhoto> photo = PhotoOfSession(path, path.filename().string(), folder);
    if (!photo) {
      return tl::unexpected(photo.error());
    }
    folder.photos.push_back(*std::move(photo));
    return folder;
  }
  Result<std::vector<std::string>> names = FilesInNaturalOrder(path);
  const Result<std::vector<std::string>> folders = FoldersIn(path);
  if (!names || !folders) {
    return tl::unexpected(names ? folders.error() : names.error());
  }
  names->insert(names->end(), folders->begin(), folders->end());
  std::sort(names->begin(), names->end(), NaturalLess);
  for (const std::string& name : *names) {
    if (!fs::is_directory(path / name, error)) {
      if (IsPicture(name)) {
        folder.photos.push_back({name, {FrameFile{path / name, 1.0, std::nullopt}}});
      } else {
        folder.ignored.push_back(name + ": not a photograph");
      }
    } else if (!Exists(path / name / "session.json")) {
      folder.ignored.push_back(name + ": a folder without session.json");
    } else if (Result<BoardPhoto> photo = PhotoOfSession(path / name, name, folder); photo) {
      folder.photos.push_back(*std::move(photo));
    } else {
      folder.ignored.push_back(photo.error().message);
    }
  }
  if (folder.photos.empty()) {
    return Fail(ErrorCode::kBadData,
                "{}: found {}; need photographs of a board, or sessions of kind board",
                path.string(), DescribeFolder(path));
  }
  return folder;
}

Result<BoardPicture> ReadBoardPicture(const BoardPhoto& photo) {
  BoardPicture picture;
  Image<float> sum;
  bool is_coded = true;
  for (const FrameFile& file : photo.files) {
    const Result<std::string> hash = CheckedHash(file);
    const Result<GreyLight> light = hash.and_then([&](const auto&) { return ReadLight(file); });
    if (!light) {
      return tl::unexpected(light.error());
    }
    picture.sha256_of_input[file.path.string()] = *hash;
    is_coded = is_coded && light->is_coded;
    if (sum.pixels.empty()) {
      sum = Image<float>(light->grey.Size());
    }
    if (Status same = CheckSize(file.path.string(), light->grey.Size(), sum.Size()); !same) {
      return tl::unexpected(same.error());
    }
    std::transform(sum.pixels.begin(), sum.pixels.end(), light->grey.pixels.begin(),
                   sum.pixels.begin(), std::plus<>());
  }
  // One 8-bit file keeps its levels; of several, or of linear light, the brightest become white.
  const bool as_it_is = is_coded && photo.files.size() == 1;
  const float white = as_it_is ? 1.0F : WhiteLevel(sum);
  if (!(white > 0.0F)) {
    return Fail(ErrorCode::kBadData, "{}: is black; photograph the board under light",
                photo.files.front().path.string());
  }
  for (float& level : sum.pixels) {
    level = is_coded ? level / white : SrgbFromLinear(std::max(level, 0.0F) / white);
  }
  picture.grey = BytesOf(sum);
  return picture;
}

}  // namespace sateen
