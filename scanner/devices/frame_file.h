#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/error.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// Checks of a file that has come from a camera, and its place. `shown` is its name in messages.

// Checks a file. kBadData: it does not decode as RAW. kDevice: it says of itself that it was
// exposed for another time than `set`, or at another ISO or, where it says one, another f-number.
[[nodiscard]] Status CheckRawFrame(const std::filesystem::path& path, const std::string& shown,
                                   const std::optional<ExposureSettings>& set);

// Moves `part`, a file in `folder`, to `name` there, or where that is taken to "STEM-2.EXT" and so
// on; never over another file. kIo; `part` is removed in any case.
[[nodiscard]] Result<std::filesystem::path> PlaceAnew(const std::filesystem::path& part,
                                                      const std::filesystem::path& folder,
                                                      const std::string& name);

}  // namespace sateen
