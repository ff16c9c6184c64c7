#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

// How "using the new intensity we then solve for a new light direction" is read.
enum class DirectionStep {
  kEquation,  // (3a)
  kFallOff    // (3b)
};

struct SeedProcedureOptions {
  double albedo = 0.99;  // of the paper, (0, 1]
  DirectionStep direction_step = DirectionStep::kEquation;
  int smoothing_passes = 2;  // of (1 2 1) / 4 along rows and columns of blocks; 0 or more
  int most_rounds = 50;      // 1 or more; the talk repeats "a handful of times"
  // Converged when no direction turns by more. [rad], > 0
  double least_turn_rad = 1e-6;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// A light as that procedure knows it: directions from a position, and an intensity for each block.
struct SeedLight {
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> intensity_rgb;  // columns x rows; zero where the sheet is not seen
  std::vector<Eigen::Vector3d> point_mm;       // of the sheet, likewise
  int rounds = 0;
  bool converged = false;
};

// At a point that block `block` shows, on the sheet or off it: off it the map is carried on with the
// square of the distances, which is more than the procedure has.
[[nodiscard]] Incident IncidentAt(const SeedLight& light, int block, const Eigen::Vector3d& x_mm);

/// Equation (0), the procedure's start: the light's intensity where the sheet is nearest to the
/// table's origin, i = I / (rho n . l), with l from the position that the ruler gave.
[[nodiscard]] Eigen::Vector3d IntensityAtCentre(const std::vector<SheetSample>& samples,
                                                const Eigen::Vector3d& position_mm, double albedo);

/// The light calibration of The Order: 1886, as the talk tells it, as the baseline to ours. From one
/// flat sheet I(x) and a position s by the ruler, l(x) = (s - x) / |s - x|:
///
///     i(x) = I(x) / (rho n . l(x)), smoothed, for each block                                     (1)
///     "then solve for a new light direction", i held:                                            (2)
///         s = argmin sum_x ((I(x) - rho i(x) n . l(x)) / I(x))^2                                (3a)
///         s = argmin sum_x (log i(x) - log phi + 2 log |s - x|)^2, over phi too                 (3b)
///     from (1) again, until no direction turns
///
/// (3a) is the talk's equation to the letter, its unknown now l; a light is in one place, so all blocks
/// share one s. But (1) has just made its residual zero for the s at hand, up to the smoothing: it
/// stays where the ruler put it, or creeps by what smoothing does to the map, some tenths of a
/// millimetre a round and not towards the light. One flat sheet cannot tell a wrong direction from an
/// intensity that varies, and a map that may vary at will takes all of it. (3b) reads it kindly: what the map shows is
/// the light's fall-off over distance, so its shape says where the light is. That closes in on the
/// truth for a point light, the error halving from round to round, and goes astray by what is
/// fall-off over angle. Either way the sheet itself solves flat by construction; only surfaces that
/// are not flat show what is wrong.
///
/// samples, blocks  of one light; blocks[i] among columns x rows is where samples[i] lies
/// Errors   kInvalidArgument: an option out of range
///          kDegenerate: no samples; the position leaves the side of the sheet that is lit
/// Cost     about 1 us a sample and round
/// Source   Neubelt and Pettineo, "Crafting a Next-Gen Material Pipeline for The Order: 1886", 2013,
///          "Light calibration". The readings (3a) and (3b) are ours.
[[nodiscard]] Result<SeedLight> CalibrateBySeedProcedure(const std::vector<SheetSample>& samples,
                                                         const std::vector<int>& blocks,
                                                         int columns, int rows,
                                                         const Eigen::Vector3d& position_mm,
                                                         const SeedProcedureOptions& options = {});

}  // namespace sateen
