#include "calibration/print/edge_width.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "core/statistics.h"

namespace sateen {
namespace {

constexpr double kFree = 0.3;                              // of a square
constexpr double kFreeOfGap = 0.8;                         // of the gap around a marker
constexpr double kNarrowestPx = 2.0;                       // in which no edge is measured
constexpr double kStepPx = 0.25;                           // between readings
constexpr std::array kAlong = {-0.15, -0.05, 0.05, 0.15};  // of the edge, where it is read

std::optional<double> LevelAt(const Image<uint8_t>& grey, const Eigen::Vector2d& at) {
  if (!(at.minCoeff() >= 0.0 && at.x() < grey.width - 1 && at.y() < grey.height - 1)) {
    return std::nullopt;
  }
  const int x = static_cast<int>(at.x());
  const int y = static_cast<int>(at.y());
  const double u = at.x() - x;
  const double v = at.y() - y;
  return (1.0 - v) * ((1.0 - u) * grey.At(x, y) + u * grey.At(x + 1, y)) +
         v * ((1.0 - u) * grey.At(x, y + 1) + u * grey.At(x + 1, y + 1));
}

// Equation (1) across the middle of the edge from a to b.
std::optional<double> WidthOf(const Image<uint8_t>& grey, const Eigen::Vector2d& a,
                              const Eigen::Vector2d& b, double free) {
  const Eigen::Vector2d along = b - a;
  const double reach_px = free * along.norm();
  if (reach_px < kNarrowestPx) {
    return std::nullopt;
  }
  const Eigen::Vector2d across = Eigen::Vector2d(-along.y(), along.x()).normalized();
  std::vector<double> profile;
  const int steps = static_cast<int>(std::floor(2.0 * reach_px / kStepPx));
  for (int step = 0; step <= steps; ++step) {
    const double t = -reach_px + step * kStepPx;
    double sum = 0.0;
    for (const double share : kAlong) {
      const auto level = LevelAt(grey, a + (0.5 + share) * along + t * across);
      if (!level) {
        return std::nullopt;
      }
      sum += *level;
    }
    profile.push_back(sum / static_cast<double>(kAlong.size()));
  }
  constexpr size_t kPixel = 4;  // readings
  double slope = 0.0;           // [grey levels a pixel]
  for (size_t i = 0; i + kPixel < profile.size(); ++i) {
    slope = std::max(slope, std::abs(profile[i + kPixel] - profile[i]));
  }
  const double contrast = std::abs(profile.back() - profile.front());
  return slope > 0.0 ? std::optional(contrast / (std::sqrt(2.0 * std::numbers::pi) * slope))
                     : std::nullopt;
}

}  // namespace

double EdgeWidthPx(const Image<uint8_t>& grey, const BoardSpec& spec, const BoardView& view) {
  const double gap = 0.5 * (spec.square_mm - spec.marker_mm) / spec.square_mm;
  const double free =
      spec.pattern == BoardPattern::kCharuco ? std::min(kFree, kFreeOfGap * gap) : kFree;
  std::vector<double> widths;
  for (size_t i = 0; i + 1 < view.ids.size(); ++i) {
    const bool same_row = view.ids[i + 1] == view.ids[i] + 1 &&
                          view.ids[i] / (spec.columns - 1) == view.ids[i + 1] / (spec.columns - 1);
    if (same_row) {
      if (const auto width = WidthOf(grey, view.corners_px[i], view.corners_px[i + 1], free)) {
        widths.push_back(*width);
      }
    }
  }
  if (widths.empty()) {
    return 0.0;
  }
  return Median(std::move(widths));
}

}  // namespace sateen
