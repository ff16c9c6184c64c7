#pragma once

#include <string>
#include <vector>

#include "calibration/response/chart_readings.h"
#include "calibration/response/linearity.h"
#include "core/error.h"

namespace sateen {

// Patch that is not one even grey under a light.
struct UnevenPatch {
  size_t light = 0;
  size_t patch = 0;
  size_t frame = 0;         // frame that shows it
  double unevenness = 0.0;  // UnevennessOf()
};

/// Finds the patches whose UnevennessOf() is above `most_uneven`. Each light is judged by one
/// frame: the brightest without a saturated site.
///
/// samples  all patches and lit frames, as SamplesOf() returns them
[[nodiscard]] std::vector<UnevenPatch> FindUnevenPatches(const ChartReadings& readings,
                                                         const std::vector<PatchSample>& samples,
                                                         double black_dn, double most_uneven);

/// Fails unless each light has patches that are neither all dark nor all saturated.
///
/// samples  samples of the patches that can be used
/// Errors   kBadData: a light without a patch, or dark or saturated in all its frames
[[nodiscard]] Status CheckChartLights(const ChartReadings& readings,
                                      const std::vector<PatchSample>& samples, double black_dn);

/// Fails unless each frame is as bright as its exposure time says, to within `most_off`. Adds a
/// warning where one is off by 0.4 %.
///
/// Errors   kBadData: a frame that is off, with the exposure time that would fit
[[nodiscard]] Status CheckExposures(const ChartReadings& readings,
                                    const std::vector<FrameBrightness>& frames, double most_off,
                                    std::vector<std::string>& warnings);

}  // namespace sateen
