#include "scanner/checks/frame_check_options.h"

#include <fmt/format.h>

#include "core/option_range.h"

namespace sateen {

Status FrameCheckOptions::Validate() const {
  struct Range {
    const char* name;
    double value;
    double most;
  };
  for (const auto& [name, value, most] :
       {Range{"max_saturated", max_saturated, 1.0}, Range{"min_level", min_level, 1.0},
        Range{"max_level_change", max_level_change, 1.0},
        Range{"max_rough_level_change", max_rough_level_change, 1.0},
        Range{"other_light_misfit", other_light_misfit, 1.0},
        Range{"max_ambient", max_ambient, 1.0}, Range{"max_drift", max_drift, 1.0},
        Range{"max_shift_px", max_shift_px, 100.0}, Range{"min_shift_peak", min_shift_peak, 1.0},
        Range{"min_shade", min_shade, 1.0}, Range{"max_exposure_error", max_exposure_error, 1.0}}) {
    if (!(value > 0.0 && value <= most)) {
      return OutOfRange(name, value, fmt::format("more than 0 and at most {:g}", most));
    }
  }
  return {};
}

}  // namespace sateen
