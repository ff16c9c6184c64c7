#include "calibration/response/chart.h"

#include <algorithm>

namespace sateen {

Status Chart::Validate(const std::string& what) const {
  constexpr size_t kFewestPatches = 3;  // white, grey, black
  constexpr size_t kMostPatches = 2000;
  constexpr double kFarthest_mm = 1e5;
  constexpr double kApart = 0.9;  // patches that touch, in a file that turns them a little
  if (!(patch_mm > 0.0 && patch_mm < 1e4)) {
    return Fail(ErrorCode::kBadData, "{}: patch_mm is {:g}; need 0 to 10,000", what, patch_mm);
  }
  if (patches.size() < kFewestPatches) {
    return Fail(ErrorCode::kBadData, "{}: patches has {}; need at least {}", what, patches.size(),
                kFewestPatches);
  }
  if (patches.size() > kMostPatches) {
    return Fail(ErrorCode::kBadData, "{}: patches has {}; need at most {}", what, patches.size(),
                kMostPatches);
  }
  for (size_t i = 0; i < patches.size(); ++i) {
    const ChartPatch& patch = patches[i];
    if (!(patch.center_mm.cwiseAbs().maxCoeff() <= kFarthest_mm)) {
      return Fail(ErrorCode::kBadData,
                  "{}: patches[{}]: center_mm is {:g}, {:g}; need {:g} at most", what, i,
                  patch.center_mm.x(), patch.center_mm.y(), kFarthest_mm);
    }
    if (!(patch.reflectance_rgb.minCoeff() > 0.0 && patch.reflectance_rgb.maxCoeff() <= 1.0)) {
      return Fail(ErrorCode::kBadData,
                  "{}: patches[{}]: reflectance of '{}' is {:g} to {:g}; need above 0 and up to 1",
                  what, i, patch.name, patch.reflectance_rgb.minCoeff(),
                  patch.reflectance_rgb.maxCoeff());
    }
    for (size_t j = 0; j < i; ++j) {
      const double apart = (patches[j].center_mm - patch.center_mm).cwiseAbs().maxCoeff();
      if (patches[j].name == patch.name || apart < kApart * patch_mm) {
        return Fail(
            ErrorCode::kBadData,
            "{}: patches '{}' and '{}' {}; need other names, and centres at least 0.9 patch_mm "
            "apart",
            what, patches[j].name, patch.name,
            patches[j].name == patch.name ? "have one name" : "overlap");
      }
    }
  }
  return {};
}

}  // namespace sateen
