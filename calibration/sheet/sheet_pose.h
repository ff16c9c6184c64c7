#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "calibration/print/pose_solve.h"
#include "core/error.h"
#include "imaging/image.h"
#include "rig/camera.h"
#include "targets/sheet_border.h"

namespace sateen {

// Pose of a sheet, from the markers of its border.
struct SheetPose {
  Eigen::Isometry3d table_from_sheet = Eigen::Isometry3d::Identity();
  // Covariance of w [rad] and d [mm] in x_in_table = exp(w) R x + t + d, and the standard
  // deviations in it. The camera's own uncertainty is not included.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Vector3d rotation_sd_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_sd_mm = Eigen::Vector3d::Zero();
  size_t markers_used = 0;
  size_t markers = 0;    // number of markers of the border
  double misfit = 0.0;   // median over the markers, as in PrintFit
  double blur_px = 0.0;  // as in PrintFit
};

// Returns how many pixels per side to average in frames for FitSheetPose(). A marker of 48 px tells
// all that one of 200 px does.
[[nodiscard]] int SheetShrink(const Camera& camera, const SheetBorder& border);

/// Fits the pose of a sheet to all frames of its session. Markers are found in the mean of the
/// frames, which has less noise and shading than each. The pose is the one under which the rendered
/// print agrees best with the mean (calibration/print/print_fit.h), without partly covered markers.
///
/// frames   one per light: grey, linear, dark-subtracted, in one unit, shrunk by SheetShrink()
/// camera   camera of the rig, with its pose, for pictures of full size
/// frame_names  names for messages; without them, "frame 3" counted from 0
/// Errors   kInvalidArgument: no frames, or of another size
///          kDegenerate: fewer than 4 markers of the border found, or all along one side; markers
///          where this border has none: another sheet; frames that show the border in different
///          places; a print that does not look like the border's
/// Cost     about 0.2 s for a border of 40 markers, whatever the pixels
[[nodiscard]] Result<SheetPose> FitSheetPose(const std::vector<Image<float>>& frames,
                                             const Camera& camera, const SheetBorder& border,
                                             const std::vector<std::string>& frame_names = {});

}  // namespace sateen
