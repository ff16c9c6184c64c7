#include "calibration/print/print_fit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "calibration/print/marker_blur.h"
#include "core/gauss_newton.h"
#include "core/linear_algebra.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr int kPrintUnknowns = 7;  // w, d, log of the blur
constexpr size_t kFewestPrintMarkers = 4;
constexpr double kStartBlurPx = 0.7;
constexpr double kLeastContrast = 1e-6;  // of a marker's brightness

using PrintUnknowns = Unknowns<kPrintUnknowns>;
using Basis = Eigen::Matrix<double, 6, 1>;

// Point where a ray from the camera meets the plane, and its derivatives by the pose: the plane's
// material at x moves by v = w x (R x) + d, and the ray then meets it elsewhere by
// R^T (r (n . v) / (n . r) - v).
struct PlanePoint {
  Eigen::Vector2d at_mm;
  Eigen::Matrix<double, 2, 6> by_pose;
};

PlanePoint MeetPlane(const Eigen::Isometry3d& camera_from_plane, const Eigen::Vector3d& ray,
                     bool with_derivative) {
  const Eigen::Matrix3d& r = camera_from_plane.linear();
  const Eigen::Vector3d n = r.col(2);
  const double cosine = n.dot(ray);
  const Eigen::Vector3d p = ray * (n.dot(camera_from_plane.translation()) / cosine);
  const Eigen::Vector3d arm = p - camera_from_plane.translation();  // R x
  PlanePoint point{(r.transpose() * arm).head<2>(), Eigen::Matrix<double, 2, 6>::Zero()};
  if (with_derivative) {
    const Eigen::Matrix<double, 2, 3> slide =
        r.leftCols<2>().transpose() * (ray * n.transpose() / cosine - Eigen::Matrix3d::Identity());
    for (Eigen::Index k = 0; k < 3; ++k) {
      point.by_pose.col(k) = slide * Eigen::Vector3d::Unit(k).cross(arm);
    }
    point.by_pose.rightCols<3>() = slide;
  }
  return point;
}

struct PatchPixel {
  Eigen::Vector3d ray;    // in the camera frame
  Eigen::Vector2d place;  // in the patch, about -1 to 1
  double value;
};

struct Patch {
  const PrintedMarker* marker;
  std::vector<PatchPixel> pixels;
  Eigen::Vector2d mm_per_px;  // along the axes of the plane
};

struct PatchSums {
  NormalEquations<kPrintUnknowns> equations;
  double contrast = 0.0;  // between white and black
};

Basis BasisOf(const PatchPixel& pixel, double white) {
  Basis basis;
  basis << 1.0, pixel.place, white, white * pixel.place;
  return basis;
}

// Returns the terms of (1) of one marker, its a and b eliminated.
PatchSums SumsOf(const Patch& patch, const Eigen::Isometry3d& pose, double blur_px) {
  const Eigen::Vector2d blur_mm = blur_px * patch.mm_per_px;
  struct Row {
    Basis basis;
    PrintUnknowns white_by;  // derivatives of W
  };
  std::vector<Row> rows;
  rows.reserve(patch.pixels.size());
  Eigen::Matrix<double, 6, 6> gram = Eigen::Matrix<double, 6, 6>::Zero();
  Basis moments = Basis::Zero();
  for (const PatchPixel& pixel : patch.pixels) {
    const PlanePoint point = MeetPlane(pose, pixel.ray, true);
    const White white = WhiteAt(*patch.marker, point.at_mm, blur_mm);
    Row row{.basis = BasisOf(pixel, white.value), .white_by = {}};
    row.white_by << point.by_pose.transpose() * white.by_x, white.by_log_blur;
    gram += row.basis * row.basis.transpose();
    moments += row.basis * pixel.value;
    rows.push_back(row);
  }
  const Basis c = SolveSymmetric(gram, moments);
  PatchSums sums{.contrast = std::abs(c[3])};
  Eigen::Matrix<double, 6, kPrintUnknowns> cross = Eigen::Matrix<double, 6, kPrintUnknowns>::Zero();
  for (size_t i = 0; i < rows.size(); ++i) {
    const PatchPixel& pixel = patch.pixels[i];
    const double residual = pixel.value - c.dot(rows[i].basis);
    const PrintUnknowns by = (c[3] + c.tail<2>().dot(pixel.place)) * rows[i].white_by;
    sums.equations.Add(by, residual);  // which is orthogonal to the basis
    cross += rows[i].basis * by.transpose();
  }
  sums.equations.information -= cross.transpose() * SolveSymmetric(gram, cross);
  return sums;
}

// Returns the pixels of the marker and its quiet rim; nothing where some are not in the picture.
std::optional<Patch> PatchOf(const Image<float>& picture, const Camera& camera,
                             const PrintedMarker& marker, const Eigen::Isometry3d& pose) {
  const double reach = 0.5 * marker.side_mm + marker.quiet_mm;
  Eigen::AlignedBox2d around;
  for (const double x : {-reach, 0.0, reach}) {
    for (const double y : {-reach, 0.0, reach}) {
      const Eigen::Vector2d at = marker.center_mm + Eigen::Vector2d(x, y);
      around.extend(PixelOfTablePoint(camera, pose * Eigen::Vector3d(at.x(), at.y(), 0.0)));
    }
  }
  if (!(around.min().minCoeff() >= 1.0 && around.max().x() <= picture.width - 2 &&
        around.max().y() <= picture.height - 2)) {
    return std::nullopt;
  }
  Patch patch{.marker = &marker, .pixels = {}, .mm_per_px = Eigen::Vector2d::Zero()};
  const Eigen::Vector2d middle = around.center();
  const Eigen::Vector2d half = 0.5 * around.sizes();
  const auto point_of = [&](double u, double v) -> std::optional<Eigen::Vector2d> {
    const std::optional<Eigen::Vector3d> ray = RayOfPixel(camera, u, v);
    return ray ? std::optional(MeetPlane(pose, *ray, false).at_mm) : std::nullopt;
  };
  const auto right = point_of(middle.x() + 0.5, middle.y());
  const auto left = point_of(middle.x() - 0.5, middle.y());
  const auto below = point_of(middle.x(), middle.y() + 0.5);
  const auto above = point_of(middle.x(), middle.y() - 0.5);
  if (!right || !left || !below || !above) {
    return std::nullopt;
  }
  patch.mm_per_px = ((*right - *left).array().square() + (*below - *above).array().square()).sqrt();
  for (int y = static_cast<int>(around.min().y()); y <= static_cast<int>(around.max().y()); ++y) {
    for (int x = static_cast<int>(around.min().x()); x <= static_cast<int>(around.max().x()); ++x) {
      const std::optional<Eigen::Vector3d> ray = RayOfPixel(camera, x, y);
      if (!ray) {
        return std::nullopt;
      }
      const Eigen::Vector2d at = MeetPlane(pose, *ray, false).at_mm - marker.center_mm;
      if (at.lpNorm<Eigen::Infinity>() <= reach) {
        patch.pixels.push_back({*ray, (Eigen::Vector2d(x, y) - middle).cwiseQuotient(half),
                                static_cast<double>(picture.At(x, y))});
      }
    }
  }
  return patch;
}

Camera AtOrigin(const Camera& lens) {
  Camera camera = lens;
  camera.table_from_camera.setIdentity();
  return camera;
}

double MisfitOf(const Patch& patch, const PatchSums& sums) {
  return std::sqrt(sums.equations.cost / static_cast<double>(patch.pixels.size())) /
         std::max(sums.contrast, kLeastContrast);
}

// Pose and blur, and (1) there.
struct PrintState {
  Eigen::Isometry3d pose;
  double log_blur;
  std::vector<PatchSums> sums;
};

PrintState StateAt(const std::vector<Patch>& patches, const Eigen::Isometry3d& pose,
                   double log_blur) {
  PrintState state{pose, log_blur, {}};
  state.sums.reserve(patches.size());
  for (const Patch& patch : patches) {
    state.sums.push_back(SumsOf(patch, pose, std::exp(log_blur)));
  }
  return state;
}

NormalEquations<kPrintUnknowns> PrintEquations(const PrintState& state) {
  NormalEquations<kPrintUnknowns> all;
  for (const PatchSums& one : state.sums) {
    all.information += one.equations.information;
    all.gradient += one.equations.gradient;
    all.cost += one.equations.cost;
  }
  return all;
}

GaussNewtonFit<kPrintUnknowns, PrintState> Descend(const std::vector<Patch>& patches,
                                                   const Eigen::Isometry3d& start) {
  return MinimizeSquares<kPrintUnknowns>(
      StateAt(patches, start, std::log(kStartBlurPx)), PrintEquations,
      [&](const PrintState& at, const PrintUnknowns& step) {
        return StateAt(patches, Moved(at.pose, step.head<6>()),
                       at.log_blur + std::clamp(step[6], -0.5, 0.5));
      },
      {.rule = StepRule::kDamping,
       .max_iterations = 30,
       .min_relative_fall = 1e-9,
       .min_damping = 1e-9});
}

}  // namespace

Result<PrintFit> FitPrint(const Image<float>& picture, const Camera& lens,
                          const std::vector<PrintedMarker>& markers,
                          const Eigen::Isometry3d& start) {
  const Camera camera = AtOrigin(lens);
  std::vector<Patch> patches;
  std::vector<size_t> marker_of_patch;
  patches.reserve(markers.size());
  for (size_t i = 0; i < markers.size(); ++i) {
    if (std::optional<Patch> patch = PatchOf(picture, camera, markers[i], start)) {
      patches.push_back(*std::move(patch));
      marker_of_patch.push_back(i);
    }
  }
  if (patches.size() < kFewestPrintMarkers) {
    return Fail(ErrorCode::kDegenerate, "{} markers lie wholly in the picture; need {}",
                patches.size(), kFewestPrintMarkers);
  }
  const auto descent = Descend(patches, start);
  const PrintState& state = descent.state;
  PrintFit fit{.camera_from_plane = state.pose, .blur_px = std::exp(state.log_blur)};
  fit.misfit.assign(markers.size(), -1.0);
  UnknownsMatrix<kPrintUnknowns> scores = UnknownsMatrix<kPrintUnknowns>::Zero();
  for (size_t i = 0; i < patches.size(); ++i) {
    fit.misfit[marker_of_patch[i]] = MisfitOf(patches[i], state.sums[i]);
    const PrintUnknowns& score = state.sums[i].equations.gradient;
    scores += score * score.transpose();
  }
  const UnknownsMatrix<kPrintUnknowns> inverse = InverseOfSymmetric(descent.equations.information);
  const auto count = static_cast<double>(patches.size());
  const double unbiased = count / std::max(count - 0.5 * kPrintUnknowns, 1.0);
  fit.covariance = unbiased * (inverse * scores * inverse).topLeftCorner<6, 6>();
  return fit;
}

std::vector<double> PrintMisfit(const Image<float>& picture, const Camera& lens,
                                const std::vector<PrintedMarker>& markers, const PrintFit& at) {
  const Camera camera = AtOrigin(lens);
  std::vector<double> misfit;
  misfit.reserve(markers.size());
  for (const PrintedMarker& marker : markers) {
    const std::optional<Patch> patch = PatchOf(picture, camera, marker, at.camera_from_plane);
    misfit.push_back(patch ? MisfitOf(*patch, SumsOf(*patch, at.camera_from_plane, at.blur_px))
                           : -1.0);
  }
  return misfit;
}

}  // namespace sateen
