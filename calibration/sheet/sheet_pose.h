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

// Where a sheet lies, by the markers of its border.
struct SheetPose {
  Eigen::Isometry3d table_from_sheet = Eigen::Isometry3d::Identity();
  // Of w (rad) and d (mm) in x_in_table = exp(w) R x + t + d, and the standard deviations in it.
  // The camera's own uncertainty is not in them.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Vector3d rotation_sd_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_sd_mm = Eigen::Vector3d::Zero();
  size_t markers_used = 0;  // of
  size_t markers = 0;       // the border has so many
  double misfit = 0.0;      // of the rendered print, root mean square, over its contrast
  double blur_px = 0.0;
};

// By how many pixels a side frames are to be shrunk before FitSheetPose(): a marker of 48 px
// tells all that one of 200 px does.
[[nodiscard]] int SheetShrink(const Camera& camera, const SheetBorder& border);

/// The pose of a sheet from all frames of its session: their markers are found in the mean of the
/// frames, which has their least noise and shading, and the pose is that under which the rendered
/// print agrees best with it (calibration/print/print_fit.h), without markers that are covered in part.
///
/// frames   one a light, grey, linear, dark-subtracted, in one unit; each shrunk by SheetShrink()
/// camera   the rig's, of the full picture, and where it stands
/// Errors   kInvalidArgument: no frames, or of another size
///          kDegenerate: fewer than 4 markers of the border found, or all along one side; markers
///          where this border has none: another sheet; frames that show the border in different
///          places, or a frame that does not: named "frame 3", counted from 0, by `frame_names` if
///          given; a print that does not look like the border's
/// Cost     about 0.2 s for a border of 40 markers, whatever the pixels
[[nodiscard]] Result<SheetPose> FitSheetPose(const std::vector<Image<float>>& frames,
                                             const Camera& camera, const SheetBorder& border,
                                             const std::vector<std::string>& frame_names = {});

}  // namespace sateen
