#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image_io.h"
#include "imaging/light_stack.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// The frames of a capture as radiance, and what was noticed on the way.
struct LoadedFrames {
  LightStack stack;
  int srgb_count = 0;  // lit frames whose transfer function was undone
  std::map<std::string, std::string> sha256_of_input;
};

/// Reads and decodes the lit frames on all threads of `task`, subtracts the mean of the dark
/// frames:
///
///     i_k = v_k / H_k - mean_d(v_d / H_d),    full_scale_k = saturation_k / H_k            (1)
///
/// v is the file's value, balanced by the rig's response (scanner/sessions/frames/sensor_reading.h), H its
/// exposure. The mean of the dark is weighted by H_d^2, because a dark frame's noise is that of the
/// read-out. A sample that is saturated before the subtraction stays at full_scale, so that a
/// bright dark frame cannot hide that it is.
///
/// Several exposures of a light are merged (scanner/sessions/frames/exposure_merge.h), camera RAW site by
/// site: a site saturates alone, and a demosaiced pixel would carry it into its neighbours.
/// full_scale is then that of the shortest. A frame whose file has a shift_px is laid over the
/// first (scanner/sessions/frames/frame_shift.h).
///
/// At least one light, each with at least one frame.
/// Memory   K images, and some sixteen planes more per thread, for any number of exposures
///
/// Errors   kIo: a file is absent or unreadable
///          kBadData: a file is no image, has another hash than recorded, or another size than the
///          first lit frame; the first such file in the order given is named; RAW and other files
///          of one light
///          kCancelled
[[nodiscard]] Result<LoadedFrames> LoadFrames(const std::vector<LightFiles>& lit,
                                              const std::vector<FrameFile>& dark, Encoding encoding,
                                              const Task& task);

// Returns the SHA-256 of the file. kBadData where the session recorded another.
[[nodiscard]] Result<std::string> CheckedHash(const FrameFile& file);

}  // namespace sateen
