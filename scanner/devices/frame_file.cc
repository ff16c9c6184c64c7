#include "scanner/devices/frame_file.h"

#include <unistd.h>

#include <cerrno>
#include <cmath>

#include "core/files/file_io.h"
#include "imaging/raw.h"

namespace sateen {
namespace {

// Files have the nominal value, or what is behind it: 1/60 s or 1/64 s, f/5.6 or f/5.66.
constexpr double kNominal = 0.1;

Status CheckValue(const std::string& shown, const char* what, const std::optional<double>& found,
                  double set) {
  if (found && *found > 0.0 && std::abs(*found - set) > kNominal * set) {
    return Fail(ErrorCode::kDevice,
                "{} was exposed with {} {:.4g}, and {:.4g} was set; set the camera to manual "
                "exposure, no bracketing",
                shown, what, *found, set);
  }
  return {};
}

}  // namespace

Status CheckRawFrame(const std::filesystem::path& path, const std::string& shown,
                     const std::optional<ExposureSettings>& set) {
  const Result<RawMosaic> mosaic = ReadRawMosaic(path);
  if (!mosaic) {
    return Fail(ErrorCode::kBadData, "{} does not decode: {}; take the frame again", shown,
                mosaic.error().message);
  }
  if (!set) {
    return {};
  }
  if (Status time = CheckValue(shown, "time [s]", mosaic->exposure_s, set->exposure_s); !time) {
    return time;
  }
  if (Status iso = CheckValue(shown, "ISO", mosaic->iso, set->iso); !iso) {
    return iso;
  }
  return CheckValue(shown, "f-number", mosaic->f_number, set->f_number);
}

Result<std::filesystem::path> PlaceAnew(const std::filesystem::path& part,
                                        const std::filesystem::path& folder,
                                        const std::string& name) {
  const std::filesystem::path file = name;
  std::filesystem::path place = folder / file;
  int failed = 0;
  // A link, because it fails where a file is, and a rename would replace it.
  for (int k = 2; link(part.c_str(), place.c_str()) != 0; ++k) {
    if (errno != EEXIST) {
      failed = errno;
      break;
    }
    place = folder / fmt::format("{}-{}{}", file.stem().string(), k, file.extension().string());
  }
  std::error_code ignored;
  std::filesystem::remove(part, ignored);
  if (failed != 0) {
    return Fail(ErrorCode::kIo, "{}: cannot be created: {}", place.string(), SystemReason(failed));
  }
  return place;
}

}  // namespace sateen
