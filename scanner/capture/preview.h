#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/task.h"
#include "scanner/capture/capture_options.h"
#include "scanner/checks/signal_levels.h"
#include "scanner/devices/rig_devices.h"

namespace sateen {

struct PreviewRequest {
  std::filesystem::path rig;  // empty: none; then `light` is a channel
  std::optional<std::string>
      light;  // by its name in the rig or its channel; absent: room light alone
  std::optional<double> exposure_s;  // absent: found by test frames
  double f_number = 8.0;
  double iso = 100.0;
  double level = 1.0;    // level of the light
  int max_width = 1600;  // width of the picture; 16 to 16384 px

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// kInvalidArgument: the name does not end in .jpg or .jpeg, which is what is written.
[[nodiscard]] Status CheckPreviewName(const std::filesystem::path& output);
// Fails if the request would be refused before a device is opened: for its options, rig or light.
[[nodiscard]] Status CheckPreview(const PreviewRequest& request);

struct Preview {
  std::string jpeg;  // sRGB, half the sensor's size or less; magenta where it saturates
  ImageSize size_px;
  ExposureSettings settings;
  SignalLevels levels;
};

/// Takes one frame to look at: framing, focus, exposure. White balance is the rig's, or else the
/// camera's own. Brightness is as exposed: saturation is shown as white. Nothing is kept.
///
/// Errors   kInvalidArgument: options; kBadData: the rig has no such light; kDevice, kTimeout, kIo
/// In every case all lights are off at the end.
[[nodiscard]] Result<Preview> TakePreview(const PreviewRequest& request, RigDevices& devices,
                                          const Task& task);

}  // namespace sateen
