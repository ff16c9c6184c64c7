#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "calibration/print/pose_solve.h"
#include "core/error.h"
#include "imaging/image.h"
#include "rig/camera.h"

namespace sateen {

// Printed marker, upright in the plane z = 0.
struct PrintedMarker {
  Eigen::Vector2d center_mm = Eigen::Vector2d::Zero();
  double side_mm = 0.0;
  double quiet_mm = 0.0;  // width of the white around it that the fit also uses
  Image<uint8_t> cells;   // 0: black; with the black frame, as MarkerCells() returns them
};

// Pose and blur of a print.
struct PrintFit {
  Eigen::Isometry3d camera_from_plane = Eigen::Isometry3d::Identity();
  // Covariance of w [rad] and d [mm] in x_in_camera = exp(w) R x + t + d.
  Matrix6d covariance = Matrix6d::Zero();
  double blur_px = 0.0;  // standard deviation of the point spread, with that of the pixel itself
  // Root mean square residual of each marker over its contrast between white and black.
  std::vector<double> misfit;
};

/// Fits the pose of a plane of printed markers and the blur, so that the rendered print agrees best
/// with the picture in all pixels around the markers:
///
///     argmin  sum_m sum_(u in m) (I(u) - a_m(u) - b_m(u) W_m(x(u)))^2                      (1)
///     W_m(x) = 1 - sum over black cells of P(x; x0, x1) P(y; y0, y1)                        (2)
///     P(x; x0, x1) = Phi((x - x0) / s) - Phi((x - x1) / s)                                  (3)
///
/// x(u) is where the ray of pixel u meets the plane. a_m and b_m are linear in u, for light that
/// varies, and are eliminated. s is the blur, laid onto the plane. Levenberg and Marquardt's method
/// on pose and blur, with the projected Jacobian of Kaufman. All edges of a marker count, not its
/// corners alone, and a symmetric blur shifts none of them.
///
/// The covariance takes residuals as correlated within a marker and independent between markers
/// (the cluster-robust estimator of Liang and Zeger, Biometrika 73, 1986).
///
/// picture  grey, linear; any unit
/// lens     its table_from_camera is ignored
/// start    camera_from_plane, to within about a quarter of a cell
/// Errors   kDegenerate: fewer than 4 markers lie wholly in the picture
/// Cost     about 1 us per pixel of the markers
[[nodiscard]] Result<PrintFit> FitPrint(const Image<float>& picture, const Camera& lens,
                                        const std::vector<PrintedMarker>& markers,
                                        const Eigen::Isometry3d& start);

// Returns the misfit of each marker in another picture, at a known pose and blur; negative where
// the marker is not wholly in the picture.
[[nodiscard]] std::vector<double> PrintMisfit(const Image<float>& picture, const Camera& lens,
                                              const std::vector<PrintedMarker>& markers,
                                              const PrintFit& at);

}  // namespace sateen
