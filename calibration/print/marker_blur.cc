#include "calibration/print/marker_blur.h"

#include <array>
#include <cmath>
#include <numbers>

namespace sateen {
namespace {

constexpr int kMostCells = 9;
constexpr double kFarSigmas = 5.0;  // distance from an edge beyond which it has no effect

// Blurred shares of a marker's cells along one axis, and their derivatives.
struct Shares {
  std::array<double, kMostCells> share = {};
  std::array<double, kMostCells> by_x = {};
  std::array<double, kMostCells> by_log_blur = {};
};

// Returns the shares at distance `x` from the marker's low edge.
Shares SharesAt(double x, int cells, double cell_mm, double blur_mm) {
  Shares shares;
  double phi = 0.0;
  double density = 0.0;
  double spread = 0.0;
  for (int i = 0; i <= cells; ++i) {
    const double a = (x - i * cell_mm) / blur_mm;
    double phi_here = a > 0.0 ? 1.0 : 0.0;
    double density_here = 0.0;
    if (std::abs(a) < kFarSigmas) {
      phi_here = 0.5 * std::erfc(-a / std::numbers::sqrt2);
      density_here = std::exp(-0.5 * a * a) / std::sqrt(2.0 * std::numbers::pi);
    }
    const double spread_here = -a * density_here;  // derivative by the logarithm of the blur
    if (i > 0) {
      const auto cell = static_cast<size_t>(i - 1);
      shares.share[cell] = phi - phi_here;  // (2)
      shares.by_x[cell] = (density - density_here) / blur_mm;
      shares.by_log_blur[cell] = spread - spread_here;
    }
    phi = phi_here;
    density = density_here;
    spread = spread_here;
  }
  return shares;
}

}  // namespace

White WhiteAt(const PrintedMarker& marker, const Eigen::Vector2d& at_mm,
              const Eigen::Vector2d& blur_mm) {
  const double cell_mm = marker.side_mm / marker.cells.width;
  const Eigen::Vector2d from_center = at_mm - marker.center_mm;
  const double half = 0.5 * marker.side_mm;
  const Shares across = SharesAt(from_center.x() + half, marker.cells.width, cell_mm, blur_mm.x());
  const Shares down = SharesAt(half - from_center.y(), marker.cells.height, cell_mm, blur_mm.y());
  White white;
  for (int row = 0; row < marker.cells.height; ++row) {
    const auto r = static_cast<size_t>(row);
    if (down.share[r] == 0.0 && down.by_x[r] == 0.0 && down.by_log_blur[r] == 0.0) {
      continue;
    }
    double sum = 0.0;
    double sum_x = 0.0;
    double sum_blur = 0.0;
    for (int column = 0; column < marker.cells.width; ++column) {
      if (marker.cells.At(column, row) == 0) {
        const auto c = static_cast<size_t>(column);
        sum += across.share[c];
        sum_x += across.by_x[c];
        sum_blur += across.by_log_blur[c];
      }
    }
    white.value -= down.share[r] * sum;
    white.by_x.x() -= down.share[r] * sum_x;
    white.by_x.y() += down.by_x[r] * sum;  // down is -y
    white.by_log_blur -= down.share[r] * sum_blur + down.by_log_blur[r] * sum;
  }
  return white;
}

}  // namespace sateen
