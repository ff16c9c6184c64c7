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

// What is within these is no fault; nor is what noise may explain.
struct LightCheckOptions {
  double albedo = 0.99;  // of the paper, (0, 1]
  // Largest change of a light's direction over the field; of the camera, of where a pixel looks as
  // seen from the lights. Degrees, (0, 90). Half a millimetre under lights 600 mm away.
  double max_direction_deg = 0.05;
  // Largest change of a light's flux against that of all lights, in any channel; (0, 100).
  double max_flux_percent = 1.0;
  // Largest change of all lights' flux together, which only albedo feels; (0, 100).
  double max_common_flux_percent = 3.0;
  // Largest slope of the sheet against where it was said to lie. Degrees, (0, 45).
  double max_sheet_deg = 0.5;
  // Largest share of the field with spots, with folds or without paper; (0, 100).
  double max_spoilt_percent = 10.0;
  // How many standard deviations a change must be from none; [2, 100].
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

struct LightCheck {
  LightVerdict verdict = LightVerdict::kHolds;  // the worst of what follows
  // Today's flux over the rig's, against the median of all lights; standard deviations.
  Eigen::Vector3d flux_ratio = Eigen::Vector3d::Ones();
  Eigen::Vector3d flux_sd = Eigen::Vector3d::Zero();
  // Where the pattern says that it has gone; zero where it need not have. The standard deviations
  // are those of a light that may have.
  Eigen::Vector3d moved_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d moved_sd_mm = Eigen::Vector3d::Zero();
  double direction_deg = 0.0;  // by how much its direction changed, worst over the field
  double direction_sd_deg = 0.0;
  double turned_deg = 0.0;
  double turned_sd_deg = 0.0;
  std::optional<size_t> lit_from;  // kElsewhere: the light whose pattern this is
  bool is_flux_off = false;        // beyond the options, also of a light that moved
  bool is_unclear = false;         // noise hides moves that are larger than the options allow
};

struct CameraCheck {
  bool has_moved = false;  // beyond the options
  // Along x, y, z of the table, and about z; zero where nothing calls for it.
  Eigen::Vector3d moved_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d moved_sd_mm = Eigen::Vector3d::Zero();
  double turned_deg = 0.0;
  double turned_sd_deg = 0.0;
  double direction_deg = 0.0;  // worst change of a light's direction at a pixel
};

struct RigCheck {
  bool holds = true;
  std::vector<LightCheck> lights;  // in the rig's order
  CameraCheck camera;
  std::vector<SheetSurface> sheets;
  // Today's flux of all lights, the median, over the rig's: paper, exposure, supply.
  Eigen::Vector3d common_flux = Eigen::Vector3d::Ones();
  bool is_common_flux_off = false;
  RigChange change;  // what explains the sheets best
  // [sheet][light][sample]: today's green over what the rig says.
  std::vector<std::vector<std::vector<double>>> ratios;
};

/// Whether sheets of white paper still look as the rig says, and if not, what has changed. Explanations
/// are those of check_model.h; chosen is the one with the least chi2 + 15 per parameter, among: lights
/// moved or turned one by one, as many as need be; the camera moved; sheets not lying as said;
/// and each with the others. A flux is free in each channel of each light.
///
/// What a blank sheet cannot tell: a camera that moved from all lights together that moved the
/// other way; a tilt of the camera from a shift (0.1 degrees look like 1 mm from 600); with a
/// single flat sheet, a light's move away from an axis turned, and moves smaller than
/// `direction_sd_deg` says. With fewer than three lights, all flux is each light's own.
///
/// sheets   at least one; samples of the rig's lights at the places that the rig's camera gives
/// faults   [light]: of a light without samples
/// Errors   kInvalidArgument: an option out of range; no camera; a distant light
///          kDegenerate: no light with at least 50 samples
/// Cost     about 0.1 ms a sample
[[nodiscard]] Result<RigCheck> CheckRig(const Rig& rig, const std::vector<SheetReadings>& sheets,
                                        const std::vector<FrameFault>& faults,
                                        const LightCheckOptions& options = {},
                                        const Task& task = {});

}  // namespace sateen
