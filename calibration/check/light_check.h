#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calibration/check/rig_change.h"
#include "calibration/check/sheet_surface.h"
#include "calibration/sheet/sheet_readings.h"
#include "core/error.h"
#include "core/task.h"
#include "rig/rig.h"

namespace sateen {

// Changes within these limits are no faults; nor are those that noise may explain.
struct LightCheckOptions {
  double albedo = 0.99;  // albedo of the paper, (0, 1]
  // Largest change of a light's direction over the field, because light or camera moved. Degrees,
  // (0, 90). 0.05 degrees are half a millimetre under lights 600 mm away.
  double max_direction_deg = 0.05;
  // Largest change of a light's flux against that of all lights, in any channel; (0, 100).
  double max_flux_percent = 1.0;
  // Largest change of all lights' flux together, which changes albedo alone; (0, 100).
  double max_common_flux_percent = 3.0;
  // Largest slope of the sheet against where it was said to lie. Degrees, (0, 45).
  double max_sheet_deg = 0.5;
  // Largest share of the field with spots, with folds or without paper; (0, 100).
  double max_spoilt_percent = 10.0;
  // Least size of a change in standard deviations; [2, 100].
  double significance = 5.0;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

enum class LightVerdict {
  kHolds,
  kDark,       // no usable frame: the light did not come on
  kSaturated,  // no usable frame: too bright to tell
  kElsewhere,  // lit from where another light is: swapped frames or cables
  kMoved,
  kTurned,  // an LED whose axis points elsewhere
  kDim,
  kBright
};

[[nodiscard]] std::string_view Name(LightVerdict verdict);

// Check of one light.
struct LightCheck {
  LightVerdict verdict = LightVerdict::kHolds;  // the worst that applies
  // Flux over the rig's, relative to the median of all lights, and its standard deviation.
  Eigen::Vector3d flux_ratio = Eigen::Vector3d::Ones();
  Eigen::Vector3d flux_sd = Eigen::Vector3d::Zero();
  // Move that explains the pattern; zero where none is needed. The standard deviations are those of
  // a move that is free.
  Eigen::Vector3d moved_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d moved_sd_mm = Eigen::Vector3d::Zero();
  double direction_deg = 0.0;  // largest change of its direction over the field
  double direction_sd_deg = 0.0;
  double turned_deg = 0.0;
  double turned_sd_deg = 0.0;
  std::optional<size_t> lit_from;  // kElsewhere: light whose pattern this is
  bool is_flux_off = false;        // true: flux beyond the limits, even if the light moved
  bool is_unclear = false;         // true: noise hides moves beyond the limits
};

// Check of the camera.
struct CameraCheck {
  bool has_moved = false;  // true: moved beyond the limits
  // Motion along x, y, z of the table, and about z; zero where none is needed.
  Eigen::Vector3d moved_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d moved_sd_mm = Eigen::Vector3d::Zero();
  double turned_deg = 0.0;
  double turned_sd_deg = 0.0;
  double direction_deg = 0.0;  // largest change of a light's direction at a pixel
};

// Check of a rig.
struct RigCheck {
  bool holds = true;
  std::vector<LightCheck> lights;  // in the rig's order
  CameraCheck camera;
  std::vector<SheetSurface> sheets;
  // Median over the lights of the flux over the rig's: paper, exposure, supply.
  Eigen::Vector3d common_flux = Eigen::Vector3d::Ones();
  bool is_common_flux_off = false;
  RigChange change;  // change that explains the sheets best
  // Green radiance over that predicted by the rig. [sheet][light][sample]
  std::vector<std::vector<std::vector<double>>> ratios;
};

/// Checks whether sheets of white paper still look as the rig predicts, and if not, finds what has
/// changed. ChooseChange() explains the sheets by lights that moved or turned, a camera that moved
/// and sheets that lie elsewhere. The flux of each light is free in each channel.
///
/// A blank sheet cannot tell
/// * a camera that moved from all lights that moved the other way;
/// * a tilt of the camera from a shift: 0.1 degrees look like 1 mm from 600 mm away;
/// * with a single flat sheet, a light that moved away from an axis that turned;
/// * moves smaller than `direction_sd_deg`;
/// * with fewer than three lights, the flux of all lights from that of each.
///
/// sheets   at least one, with samples at the places that the rig's camera gives
/// faults   [light]: reason why a light has no samples
/// Errors   kInvalidArgument: an option out of range; no camera; a distant light
///          kDegenerate: no light with at least 50 samples
/// Cost     about 0.1 ms per sample
[[nodiscard]] Result<RigCheck> CheckRig(const Rig& rig, const std::vector<SheetReadings>& sheets,
                                        const std::vector<FrameFault>& faults,
                                        const LightCheckOptions& options = {},
                                        const Task& task = {});

}  // namespace sateen
