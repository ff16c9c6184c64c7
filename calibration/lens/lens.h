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
  // A view whose error is above this many times the median of all is left out; > 1.
  double outlier_ratio = 3.0;
  // Parts of the views, each held out once; at least 2.
  int folds = 5;
  // Of the grid in which the corners are counted; at least 2 each.
  ImageSize coverage_cells = {6, 4};

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

struct LensViewReport {
  std::string name;           // the view's own, or "view 3"
  std::string left_out = {};  // why it is not used; empty where it is
  size_t corners = 0;         // found
  double edge_px = 0.0;       // how blurred its edges are, as in BoardView
  double rms_px = 0.0;        // length of the residuals; 0 where the view is left out unfitted
  double held_out_px = 0.0;   // the same by a lens fitted without the view; 0 where not used
  Eigen::Vector3d normal_in_camera = Eigen::Vector3d::Zero();  // of the board, where used
};

struct LensFit {
  Camera camera;                          // its pose is the identity
  double rms_px = 0.0;                    // length of the residuals over the views used
  double held_out_rms_px = 0.0;           // of views held out, each with its own pose fitted
  std::array<double, 4> pinhole_sd = {};  // standard deviations: fx, fy, cx, cy [px]
  std::array<double, 5> distortion_sd = {};
  // How well distortion is known at the image's corners, where its terms do the most: of the
  // displacement there, worst corner, from lenses fitted without parts of the views (jackknife).
  double corner_sd_px = 0.0;
  std::vector<LensViewReport> views;  // as given
  Image<int> coverage;                // corners used, in a grid over the image
  std::vector<std::string> warnings;  // what to photograph for a better lens; empty if all is well
};

/// Focal lengths, principal point and distortion of rig/camera.h from views of a board in different
/// poses, by Zhang's method ("A flexible new technique for camera calibration", PAMI 22(11), 2000)
/// as OpenCV has it. View by view the worst is left out as long as it is an outlier. Each view is
/// also held out once, with its part of the views: what remains explains it as well as itself, or
/// the lens is fitted to noise.
///
/// views    of one camera at one focus, `size_px` large; at least 3, better 15 with tilts of 30
///          degrees each way, that reach into the corners of the image
/// Errors   kInvalidArgument: an option out of range; views of another size
///          kDegenerate: fewer than 3 usable views; more than a third are outliers; views so alike
///          that they cannot tell the focal length
/// Cost     some 0.1 s for 20 views of 100 corners and as much again for each part
[[nodiscard]] Result<LensFit> CalibrateLens(const std::vector<BoardView>& views, ImageSize size_px,
                                            const LensFitOptions& options = {});

// For `warnings`, from the other fields.
[[nodiscard]] std::vector<std::string> WarningsOf(const LensFit& fit);

// The largest angle between the boards of two views used.
[[nodiscard]] double SpreadOfTiltsRad(const LensFit& fit);

}  // namespace sateen
