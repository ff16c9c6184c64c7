#include "calibration/check/sheet_surface.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr int kFewestSurfaceLights = 4;
constexpr double kSpot = 0.02;
constexpr double kFoldRad = 0.5 * kRadPerDeg;
constexpr double kSignificant = 5.0;

// Normal equations (1) of one block.
struct SurfaceSystem {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double sum2 = 0.0;
  int lights = 0;

  void Add(double ratio, const Eigen::Vector3d& row) {
    matrix += row * row.transpose();
    gradient += row * ratio;
    sum2 += ratio * ratio;
    ++lights;
  }
};

}  // namespace

SheetSurface SurfaceOf(const SheetReadings& sheet, const Lights& lights,
                       const ExpectedGreen& expected) {
  std::vector<SurfaceSystem> blocks(static_cast<size_t>(sheet.columns) *
                                    static_cast<size_t>(sheet.rows));
  for (size_t k = 0; k < lights.size(); ++k) {
    for (size_t j = 0; j < sheet.samples[k].size(); ++j) {
      const SheetSample& sample = sheet.samples[k][j];
      const Eigen::Vector3d u =
          (Eigen::Vector3d::UnitX() - sample.normal * sample.normal.x()).normalized();
      const Eigen::Vector3d l = (lights[k].position_mm - sample.point_mm).normalized();
      const double now = expected(k, sample);
      const double l_n = l.dot(sample.normal);
      if (now > 0.0) {
        blocks[static_cast<size_t>(sheet.blocks[k][j])].Add(
            sample.radiance_rgb[1] / now - 1.0,
            {1.0, -l.dot(u) / l_n, -l.dot(sample.normal.cross(u)) / l_n});
      }
    }
  }
  struct Found {
    Eigen::Vector3d is;
    Eigen::Vector3d sd;  // standard deviations for noise of 1
  };
  std::vector<Found> found;
  std::vector<double> left;
  for (const SurfaceSystem& block : blocks) {
    if (block.lights < kFewestSurfaceLights) {
      continue;
    }
    const Eigen::Matrix3d covariance =
        (block.matrix + 1e-9 * Eigen::Matrix3d::Identity()).inverse();
    const Eigen::Vector3d is = covariance * block.gradient;
    found.push_back({is, covariance.diagonal().cwiseSqrt()});
    left.push_back(std::sqrt(std::max(0.0, block.sum2 - block.gradient.dot(is)) /
                             std::max(1, block.lights - 3)));
  }
  SheetSurface surface;
  if (found.empty()) {
    return surface;
  }
  const double noise = std::max(Median(left), 1e-9);
  const double count =
      sheet.blank_blocks > 0 ? sheet.blank_blocks : static_cast<double>(blocks.size());
  double spots = count - static_cast<double>(found.size());  // nothing there: no paper
  double folds = 0.0;
  for (const Found& block : found) {
    const double slope = block.is.tail<2>().norm();
    const bool is_spot =
        std::abs(block.is[0]) > std::max(kSpot, kSignificant * noise * block.sd[0]);
    const bool is_fold =
        slope > std::max(std::tan(kFoldRad), kSignificant * noise * block.sd.tail<2>().maxCoeff());
    spots += is_spot ? 1.0 : 0.0;
    folds += is_fold && !is_spot ? 1.0 : 0.0;
    if (is_fold && !is_spot) {
      surface.steepest_deg = std::max(surface.steepest_deg, std::atan(slope) * kDegPerRad);
    }
  }
  surface.spots = spots / count;
  surface.folds = folds / count;
  return surface;
}

}  // namespace sateen
