#pragma once

#include <string>
#include <vector>

#include "calibration/response/chart_readings.h"
#include "calibration/response/linearity.h"
#include "core/error.h"

namespace sateen {

// A patch that is not one even grey under a light.
struct UnevenPatch {
  size_t light = 0;
  size_t patch = 0;
  size_t frame = 0;         // that shows it
  double unevenness = 0.0;  // relative, beyond the noise
};

/// The patches whose UnevennessOf() is above `most_uneven`, each light's by the frame whose brightest
/// patch is brightest without a saturated site.
///
/// samples  of all patches and lit frames, as SamplesOf() has them
[[nodiscard]] std::vector<UnevenPatch> FindUnevenPatches(const ChartReadings& readings,
                                                         const std::vector<PatchSample>& samples,
                                                         double black_dn, double most_uneven);

/// That each light has a frame with something in it, and one that is not saturated all over.
///
/// samples  of the patches that can be used
/// Errors   kBadData: a light without a patch, or dark or saturated in all its frames
[[nodiscard]] Status CheckChartLights(const ChartReadings& readings,
                                      const std::vector<PatchSample>& samples, double black_dn);

/// That frames are as bright as their exposure times say, to within `most_off`; adds a warning where
/// one is off by 0.4 %.
///
/// Errors   kBadData: a frame that is off, with the time that it would fit
[[nodiscard]] Status CheckExposures(const ChartReadings& readings,
                                    const std::vector<FrameBrightness>& frames, double most_off,
                                    std::vector<std::string>& warnings);

}  // namespace sateen
