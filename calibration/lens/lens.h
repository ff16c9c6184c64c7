#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "calibration/print/board_find.h"
#include "core/error.h"
#include "imaging/image.h"
#include "rig/camera.h"

namespace sateen {

struct LensFitOptions {
  // Ratio of a view's error to the median of all above which it is left out; > 1.
  double outlier_ratio = 3.0;
  // Number of parts into which the views are divided, each held out once; at least 2.
  int folds = 5;
  // Size of the grid in which the corners are counted; at least 2 x 2.
  ImageSize coverage_cells = {6, 4};

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// One view and how the lens explains it.
struct LensViewReport {
  std::string name;           // name of the view, or "view 3"
  std::string left_out = {};  // reason why it is not used; empty where it is
  size_t corners = 0;         // corners found
  double edge_px = 0.0;       // width of its edges, as in BoardView
  double rms_px = 0.0;        // root mean square length of the residuals; 0 where not fitted
  double held_out_px = 0.0;   // the same by a lens fitted without the view; 0 where not used
  Eigen::Vector3d normal_in_camera = Eigen::Vector3d::Zero();  // normal of the board, where used
};

// Lens and how well it is known.
struct LensFit {
  Camera camera;                          // its pose is the identity
  double rms_px = 0.0;                    // root mean square length of residuals, views used
  double held_out_rms_px = 0.0;           // the same of views held out, each with a pose of its own
  std::array<double, 4> pinhole_sd = {};  // standard deviations: fx, fy, cx, cy [px]
  std::array<double, 5> distortion_sd = {};  // standard deviations: k1, k2, p1, p2, k3
  // Standard deviation of the displacement by distortion at the worst corner of the image, where
  // its terms do the most: by the jackknife, from lenses fitted without parts of the views.
  double corner_sd_px = 0.0;
  std::vector<LensViewReport> views;  // as given
  Image<int> coverage;                // number of corners used, in a grid over the image
  std::vector<std::string> warnings;  // advice what to photograph; empty if all is well
};

/// Fits focal lengths, principal point and distortion of rig/camera.h to views of a board in
/// different poses, by Zhang's method ("A flexible new technique for camera calibration", PAMI
/// 22(11), 2000) as OpenCV has it. The worst view is left out as long as it is an outlier. Each
/// part of the views is also held out once: where the lens of the others explains it worse than
/// they explain themselves, the lens is fitted to noise.
///
/// views    views by one camera at one focus, of `size_px`; at least 3, better 15 with tilts of 30
///          degrees each way that reach into the corners of the image
/// Errors   kInvalidArgument: an option out of range; views of another size
///          kDegenerate: fewer than 3 usable views; more than a third are outliers; views so alike
///          that they do not determine the focal length
/// Cost     some 0.1 s for 20 views of 100 corners, and as much again for each part
[[nodiscard]] Result<LensFit> CalibrateLens(const std::vector<BoardView>& views, ImageSize size_px,
                                            const LensFitOptions& options = {});

}  // namespace sateen
