#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image_io.h"
#include "imaging/light_stack.h"
#include "scanner/capture_plan.h"

namespace sateen {

// The frames of a capture as radiance, and what was noticed on the way.
struct LoadedFrames {
  LightStack stack;
  int srgb_count = 0;  // lit frames whose transfer function was undone
  std::map<std::string, std::string> sha256_of_input;
};

/// Reads and decodes the lit frames on all threads of `task`, subtracts the mean of the dark frames:
///
///     i_k = v_k / H_k - mean_d(v_d / H_d),    full_scale_k = saturation_k / H_k            (1)
///
/// v is the file's value, balanced by the rig's response (scanner/sensor_reading.h), H its exposure. A sample that is saturated before the subtraction stays
/// at full_scale, so that a bright dark frame cannot hide that it is. At least one lit frame.
///
/// Errors   kIo: a file is absent or unreadable
///          kBadData: a file is no image, has another hash than recorded, or another size than the
///          first lit frame; the first such file in the order given is named
///          kCancelled
[[nodiscard]] Result<LoadedFrames> LoadFrames(const std::vector<FrameFile>& lit,
                                              const std::vector<FrameFile>& dark, Encoding encoding,
                                              const Task& task);

// SHA-256 of the file. kBadData where the session recorded another.
[[nodiscard]] Result<std::string> CheckedHash(const FrameFile& file);

// kBadData unless `size` is that of the frames. `what` opens the message: the file.
[[nodiscard]] Status CheckSize(const std::string& what, ImageSize size, ImageSize frame_size);

}  // namespace sateen
