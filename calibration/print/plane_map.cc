#include "calibration/print/plane_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "core/linear_algebra.h"

namespace sateen {
namespace {

constexpr double kThinnest = 0.01;  // points that lie closer to a line, relative to its length
constexpr double kQuadrant = 0.3;   // of a square: where a quadrant of a crossing is read
constexpr double kSmallestWindowPx = 2.0;
constexpr double kLargestWindowPx = 12.0;

bool LieInALine(const std::vector<Eigen::Vector3d>& points_mm) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector3d& point : points_mm) {
    mean += point.head<2>() / static_cast<double>(points_mm.size());
  }
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector3d& point : points_mm) {
    const Eigen::Vector2d off = point.head<2>() - mean;
    spread += off * off.transpose();
  }
  const Eigen::VectorXd squares = DecomposeSymmetric(spread).values;
  return !(squares[0] > kThinnest * kThinnest * squares[1]);
}

}  // namespace

Eigen::Vector2d MapPoint(const PlaneMap& map, const Eigen::Vector2d& x_mm) {
  return (map * x_mm.homogeneous()).hnormalized();
}

std::optional<PlaneMap> FitPlaneMap(const std::vector<Eigen::Vector3d>& points_mm,
                                    const std::vector<Eigen::Vector2d>& corners_px,
                                    std::optional<double> slack_px) {
  if (points_mm.size() < 4 || LieInALine(points_mm)) {
    return std::nullopt;
  }
  std::vector<cv::Point2d> from;
  std::vector<cv::Point2d> to;
  from.reserve(points_mm.size());
  to.reserve(points_mm.size());
  for (size_t i = 0; i < points_mm.size(); ++i) {
    from.emplace_back(points_mm[i].x(), points_mm[i].y());
    to.emplace_back(corners_px[i].x(), corners_px[i].y());
  }
  const cv::Mat found =
      slack_px ? cv::findHomography(from, to, cv::RANSAC, *slack_px) : cv::findHomography(from, to);
  if (found.empty()) {
    return std::nullopt;
  }
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(found.ptr<double>());
}

std::optional<double> CrossingContrast(const Image<uint8_t>& grey, const PlaneMap& map,
                                       const Eigen::Vector2d& at_mm, double square_mm) {
  double contrast = 0.0;
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      const Eigen::Vector2d at =
          MapPoint(map, at_mm + kQuadrant * square_mm * Eigen::Vector2d(x, y));
      if (!(at.minCoeff() >= 0.0 && at.x() <= grey.width - 1 && at.y() <= grey.height - 1)) {
        return std::nullopt;
      }
      const uint8_t value =
          grey.At(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
      contrast += 0.5 * x * y * value;
    }
  }
  return contrast;
}

int CornerWindowPx(const PlaneMap& map, const Eigen::Vector2d& at_mm, double reach_mm) {
  const Eigen::Vector2d at = MapPoint(map, at_mm);
  const double along_x = (MapPoint(map, at_mm + reach_mm * Eigen::Vector2d::UnitX()) - at).norm();
  const double along_y = (MapPoint(map, at_mm + reach_mm * Eigen::Vector2d::UnitY()) - at).norm();
  return static_cast<int>(
      std::clamp(std::min(along_x, along_y), kSmallestWindowPx, kLargestWindowPx));
}

}  // namespace sateen
