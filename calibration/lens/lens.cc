#include "calibration/lens/lens.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "calibration/lens/lens_check.h"
#include "calibration/print/plane_map.h"
#include "calibration/print/pose_solve.h"
#include "core/angle.h"
#include "core/statistics.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr size_t kFewestViews = 3;
constexpr size_t kFewestCornersOfView = 6;
constexpr double kNoOutlierPx = 0.05;  // error below which no view is an outlier
constexpr double kAlike = 5.0 * kRadPerDeg;
constexpr double kUnknownFocal = 0.05;  // relative standard deviation

// Lens of one set of views, as OpenCV fits it.
struct RawLensFit {
  Camera camera;
  std::vector<double> sd;
  std::vector<double> rms_px;  // [view]
  std::vector<Eigen::Vector3d> normals;
  double all_rms_px = 0.0;
};

// Indices of the views that a fit takes.
using ViewSet = std::vector<size_t>;

Result<RawLensFit> RawFit(const std::vector<BoardView>& views, const ViewSet& set,
                          ImageSize size_px) {
  std::vector<std::vector<cv::Point3f>> points(set.size());
  std::vector<std::vector<cv::Point2f>> corners(set.size());
  for (size_t i = 0; i < set.size(); ++i) {
    const BoardView& view = views[set[i]];
    points[i].reserve(view.ids.size());
    corners[i].reserve(view.ids.size());
    for (size_t j = 0; j < view.ids.size(); ++j) {
      points[i].emplace_back(static_cast<float>(view.points_mm[j].x()),
                             static_cast<float>(view.points_mm[j].y()), 0.0F);
      corners[i].emplace_back(static_cast<float>(view.corners_px[j].x()),
                              static_cast<float>(view.corners_px[j].y()));
    }
  }
  cv::Mat k;
  cv::Mat distortion;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  cv::Mat sd;
  cv::Mat pose_sd;
  cv::Mat rms;
  RawLensFit fit;
  try {
    fit.all_rms_px = cv::calibrateCamera(points, corners, {size_px.width, size_px.height}, k,
                                         distortion, rotations, translations, sd, pose_sd, rms);
  } catch (const cv::Exception& error) {
    return Fail(ErrorCode::kDegenerate, "the views do not determine a lens ({}); tilt the board",
                error.err);
  }
  fit.camera.size_px = size_px;
  fit.camera.fx = k.at<double>(0, 0);
  fit.camera.fy = k.at<double>(1, 1);
  fit.camera.cx = k.at<double>(0, 2);
  fit.camera.cy = k.at<double>(1, 2);
  std::copy_n(distortion.ptr<double>(), 5, fit.camera.distortion.begin());
  fit.sd.assign(sd.ptr<double>(), sd.ptr<double>() + 9);
  fit.rms_px.assign(rms.ptr<double>(), rms.ptr<double>() + set.size());
  fit.normals.reserve(set.size());
  for (const cv::Mat& rotation : rotations) {
    const Eigen::Vector3d w = Eigen::Map<const Eigen::Vector3d>(rotation.ptr<double>());
    fit.normals.emplace_back(Eigen::AngleAxisd(w.norm(), w.stableNormalized()) *
                             Eigen::Vector3d::UnitZ());
  }
  return fit;
}

// Fits the views of `set`, and leaves out the worst as long as it is an outlier.
Result<RawLensFit> FitWithoutOutliers(const std::vector<BoardView>& views, ViewSet& set,
                                      const LensFitOptions& options, LensFit& report) {
  const size_t most = set.size() / 3;
  size_t left_out = 0;
  while (true) {
    Result<RawLensFit> fit = RawFit(views, set, report.camera.size_px);
    if (!fit) {
      return fit;
    }
    const auto worst = std::max_element(fit->rms_px.begin(), fit->rms_px.end());
    const double limit_px = options.outlier_ratio * Median(fit->rms_px);
    if (*worst <= std::max(limit_px, kNoOutlierPx)) {
      return fit;
    }
    const auto at = worst - fit->rms_px.begin();
    LensViewReport& view = report.views[set[static_cast<size_t>(at)]];
    view.rms_px = *worst;
    view.left_out = fmt::format(
        "its error of {:.2f} px is above {:.2f} px, {} times the median; was the board bent or "
        "moving?",
        *worst, limit_px, options.outlier_ratio);
    set.erase(set.begin() + at);
    if (++left_out > most || set.size() < kFewestViews) {
      return Fail(ErrorCode::kDegenerate,
                  "{} views of {} do not fit the others ({}: {}); need a flat board, one focus and "
                  "the right board text",
                  left_out, left_out + set.size(), view.name, view.left_out);
    }
  }
}

// Returns by how much distortion displaces points that a pinhole camera of the same matrix has at
// the corners of the image; nothing where the distortion folds before it reaches them.
std::optional<Eigen::Matrix<double, 2, 4>> CornerDisplacements(const Camera& lens) {
  Eigen::Matrix<double, 2, 4> displacements;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector2d corner(i % 2 == 0 ? 0.0 : lens.size_px.width - 1.0,
                                 i < 2 ? 0.0 : lens.size_px.height - 1.0);
    const auto at = PixelOfPinholePixel(lens, corner.x(), corner.y());
    if (!at) {
      return std::nullopt;
    }
    displacements.col(i) = *at - corner;
  }
  return displacements;
}

// Returns the standard deviation by the jackknife, from lenses each fitted without one part.
double CornerSdPx(const std::vector<Camera>& lenses) {
  std::vector<Eigen::Matrix<double, 2, 4>> displacements;
  Eigen::Matrix<double, 2, 4> mean = Eigen::Matrix<double, 2, 4>::Zero();
  const auto count = static_cast<double>(lenses.size());
  for (const Camera& lens : lenses) {
    const auto own = CornerDisplacements(lens);
    if (!own) {
      return std::numeric_limits<double>::infinity();
    }
    displacements.push_back(*own);
    mean += *own / count;
  }
  Eigen::Matrix<double, 1, 4> variance = Eigen::Matrix<double, 1, 4>::Zero();
  for (const auto& own : displacements) {
    variance += (count - 1.0) / count * (own - mean).colwise().squaredNorm();
  }
  return std::sqrt(variance.maxCoeff());
}

// Fills in the errors of views by lenses fitted without them, and how these lenses differ.
Status HoldOut(const std::vector<BoardView>& views, const ViewSet& set, size_t folds,
               LensFit& report) {
  folds = std::min(folds, set.size());
  double sum_px2 = 0.0;
  size_t corners = 0;
  std::vector<Camera> lenses;
  for (size_t fold = 0; fold < folds; ++fold) {
    ViewSet others;
    others.reserve(set.size());
    for (size_t i = 0; i < set.size(); ++i) {
      if (i % folds != fold) {
        others.push_back(set[i]);
      }
    }
    const Result<RawLensFit> fit = RawFit(views, others, report.camera.size_px);
    if (!fit) {
      return tl::unexpected<Error>(fit.error());
    }
    lenses.push_back(fit->camera);
    for (size_t i = fold; i < set.size(); i += folds) {
      const BoardView& view = views[set[i]];
      const Result<PlanePose> pose = SolvePlanePose(fit->camera, view.points_mm, view.corners_px);
      if (!pose) {
        return Fail(ErrorCode::kDegenerate, "{}: {}", report.views[set[i]].name,
                    pose.error().message);
      }
      report.views[set[i]].held_out_px = pose->rms_px;
      sum_px2 += pose->rms_px * pose->rms_px * static_cast<double>(view.ids.size());
      corners += view.ids.size();
    }
  }
  report.corner_sd_px = CornerSdPx(lenses);
  report.held_out_rms_px = std::sqrt(sum_px2 / static_cast<double>(corners));
  return {};
}

// Returns the views that can be used; the reports of the others say why not.
ViewSet UsableViews(const std::vector<BoardView>& views, LensFit& report) {
  ViewSet set;
  set.reserve(views.size());
  report.views.reserve(views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    const BoardView& view = views[i];
    report.views.push_back({.name = view.name.empty() ? fmt::format("view {}", i + 1) : view.name,
                            .corners = view.ids.size(),
                            .edge_px = view.edge_px});
    if (view.ids.size() < kFewestCornersOfView || !FitPlaneMap(view.points_mm, view.corners_px)) {
      report.views.back().left_out = fmt::format("{} corners; need {} in more than one row",
                                                 view.ids.size(), kFewestCornersOfView);
    } else {
      set.push_back(i);
    }
  }
  return set;
}

void CountCorners(const BoardView& view, Image<int>& cells) {
  for (const Eigen::Vector2d& corner : view.corners_px) {
    const double x = (corner.x() + 0.5) * cells.width / view.size_px.width;
    const double y = (corner.y() + 0.5) * cells.height / view.size_px.height;
    ++cells.At(std::clamp(static_cast<int>(x), 0, cells.width - 1),
               std::clamp(static_cast<int>(y), 0, cells.height - 1));
  }
}

}  // namespace

Status LensFitOptions::Validate() const {
  if (!(outlier_ratio > 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "outlier_ratio = {}; need > 1", outlier_ratio);
  }
  if (folds < 2) {
    return Fail(ErrorCode::kInvalidArgument, "folds = {}; need >= 2", folds);
  }
  if (coverage_cells.width < 2 || coverage_cells.height < 2) {
    return Fail(ErrorCode::kInvalidArgument, "coverage_cells = {} x {}; need >= 2 each",
                coverage_cells.width, coverage_cells.height);
  }
  return {};
}

Result<LensFit> CalibrateLens(const std::vector<BoardView>& views, ImageSize size_px,
                              const LensFitOptions& options) {
  if (const Status valid = options.Validate(); !valid) {
    return tl::unexpected<Error>(valid.error());
  }
  LensFit report;
  report.camera.size_px = size_px;
  ViewSet set = UsableViews(views, report);
  for (size_t i = 0; i < views.size(); ++i) {
    if (!(views[i].size_px == size_px)) {
      return Fail(ErrorCode::kInvalidArgument, "{} is {} x {} px; need {} x {}, as the others",
                  report.views[i].name, views[i].size_px.width, views[i].size_px.height,
                  size_px.width, size_px.height);
    }
  }
  if (set.size() < kFewestViews) {
    return Fail(ErrorCode::kDegenerate,
                "{} usable views of the board of {}; need {}, better 15, tilted and reaching into "
                "the image's corners",
                set.size(), views.size(), kFewestViews);
  }
  const Result<RawLensFit> fit = FitWithoutOutliers(views, set, options, report);
  if (!fit) {
    return tl::unexpected<Error>(fit.error());
  }
  report.camera = fit->camera;
  report.rms_px = fit->all_rms_px;
  std::copy_n(fit->sd.begin(), 4, report.pinhole_sd.begin());
  std::copy_n(fit->sd.begin() + 4, 5, report.distortion_sd.begin());
  report.coverage = Image<int>(options.coverage_cells);
  for (size_t i = 0; i < set.size(); ++i) {
    report.views[set[i]].rms_px = fit->rms_px[i];
    report.views[set[i]].normal_in_camera = fit->normals[i];
    CountCorners(views[set[i]], report.coverage);
  }
  const double focal_sd = report.pinhole_sd[0] / report.camera.fx;
  if (SpreadOfTiltsRad(report) < kAlike || !(focal_sd < kUnknownFocal)) {
    return Fail(
        ErrorCode::kDegenerate,
        "the views are too alike: tilts differ by {:.1f} degrees and leave the focal length "
        "known to {:.1f} %; tilt the board by 20 to 40 degrees each way",
        SpreadOfTiltsRad(report) * kDegPerRad, 100.0 * focal_sd);
  }
  if (const Status held_out = HoldOut(views, set, static_cast<size_t>(options.folds), report);
      !held_out) {
    return tl::unexpected<Error>(held_out.error());
  }
  report.warnings = WarningsOf(report);
  return report;
}

}  // namespace sateen
