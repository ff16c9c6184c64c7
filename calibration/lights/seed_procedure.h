#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

// Readings of "using the new intensity we then solve for a new light direction".
enum class DirectionStep {
  kEquation,  // (3a)
  kFallOff    // (3b)
};

struct SeedProcedureOptions {
  double albedo = 0.99;  // albedo of the paper, (0, 1]
  DirectionStep direction_step = DirectionStep::kEquation;
  int smoothing_passes = 2;  // passes of (1 2 1) / 4 along rows and columns of blocks; 0 or more
  int most_rounds = 50;      // 1 or more; the talk repeats "a handful of times"
  // Largest change of a direction at which the procedure has converged. [rad], > 0
  double least_turn_rad = 1e-6;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Light of that procedure: directions from a position, and an intensity for each block.
struct SeedLight {
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> intensity_rgb;  // [block]; zero where the sheet is not seen
  std::vector<Eigen::Vector3d> point_mm;       // [block]: point of the sheet; zero likewise
  int rounds = 0;
  bool converged = false;
};

// Returns the incident light at a point that a block shows, on the sheet or off it. Off the sheet
// the map is extrapolated with the square of the distances, which the procedure itself does not do.
[[nodiscard]] Incident IncidentAt(const SeedLight& light, int block, const Eigen::Vector3d& x_mm);

/// Returns the start of the procedure: the light's intensity i = I / (rho n . l) where the sheet is
/// nearest to the table's origin, with l from the ruler's position.
[[nodiscard]] Eigen::Vector3d IntensityAtCentre(const std::vector<SheetSample>& samples,
                                                const Eigen::Vector3d& position_mm, double albedo);

/// Calibrates a light as the talk on The Order: 1886 tells it, as the baseline to our own method.
/// From one flat sheet I(x) and a position s by the ruler, l(x) = (s - x) / |s - x|:
///
///     i(x) = I(x) / (rho n . l(x)), smoothed, for each block                                  (1)
///     "then solve for a new light direction", i held:                                         (2)
///         s = argmin sum_x ((I(x) - rho i(x) n . l(x)) / I(x))^2                             (3a)
///         s = argmin sum_x (log i(x) - log phi + 2 log |s - x|)^2, over phi too              (3b)
///     from (1) again, until no direction changes
///
/// (3a) is the talk's equation to the letter, its unknown now l. A light is in one place, so all
/// blocks share one s. But (1) has just made the residual zero for the present s, up to the
/// smoothing: s stays where the ruler put it, or drifts by what smoothing does to the map, some
/// tenths of a millimetre per round and not towards the light. One flat sheet cannot tell a wrong
/// direction from an intensity that varies, and a free map takes up all of the difference.
///
/// (3b) is a kind reading: the map shows the light's fall-off over distance, so its shape tells
/// where the light is. This converges to the truth for a point light, the error halving from round
/// to round; fall-off over angle leads it astray. Either way the sheet itself solves flat by
/// construction. Only surfaces that are not flat show the error.
///
/// blocks   block of each sample, in a grid of columns x rows
/// position_mm  s by the ruler
/// Errors   kInvalidArgument: an option out of range
///          kDegenerate: no samples; the position leaves the side of the sheet that is lit
/// Cost     about 1 us per sample and round
/// Source   Neubelt and Pettineo, "Crafting a Next-Gen Material Pipeline for The Order: 1886",
///          2013, "Light calibration". The readings (3a) and (3b) are ours.
[[nodiscard]] Result<SeedLight> CalibrateBySeedProcedure(const std::vector<SheetSample>& samples,
                                                         const std::vector<int>& blocks,
                                                         int columns, int rows,
                                                         const Eigen::Vector3d& position_mm,
                                                         const SeedProcedureOptions& options = {});

}  // namespace sateen
