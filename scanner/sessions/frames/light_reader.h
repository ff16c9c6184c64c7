#pragma once

#include <map>
#include <string>

#include "core/error.h"
#include "imaging/image_io.h"
#include "imaging/light_stack.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// Result of one light's files together: balanced radiance, nothing subtracted.
struct LightReading {
  LightFrame frame;
  bool was_srgb = false;
  std::map<std::string, std::string> sha256_of_input;
};

/// Reads the file of a light, or merges its several exposures (scanner/sessions/frames/exposure_merge.h),
/// one after the other. A saturated RAW site saturates every pixel that it has a part in.
///
/// Errors   as LoadFrames()
[[nodiscard]] Result<LightReading> ReadLight(const LightFiles& files, Encoding encoding);

}  // namespace sateen
