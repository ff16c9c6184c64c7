#include "rig/table_grid.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/check.h"
#include "rig/pixel_cubic.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr int kSpacingPx = 16;        // to begin with
constexpr double kMaxErrorPx = 5e-4;  // at the middle of each cell; elsewhere up to 1.2 times it
constexpr size_t kManyKnots = 65536;  // more than these, and than pixels, are not worth it

Cubic<double> Component(const Cubic<Eigen::Vector2d>& cubic, Eigen::Index coordinate) {
  Cubic<double> one;
  one.a = cubic.a[coordinate];
  one.b = cubic.b[coordinate];
  one.c = cubic.c[coordinate];
  one.d = cubic.d[coordinate];
  return one;
}

tl::unexpected<Error> NotSeen(double u, double v) {
  return Fail(ErrorCode::kBadData,
              "camera: pixel ({:.0f}, {:.0f}) does not see the table with this lens and pose; "
              "calibrate the camera again",
              u, v);
}

}  // namespace

Result<TableGrid> TableGrid::Make(const Camera& camera) {
  const auto [width, height] = camera.size_px;
  SATEEN_CHECK(width > 0 && height > 0);
  int columns = std::max(kFewestIntervals, (width - 1 + kSpacingPx - 1) / kSpacingPx);
  int rows = std::max(kFewestIntervals, (height - 1 + kSpacingPx - 1) / kSpacingPx);
  double error_px = 0.0;
  while (static_cast<size_t>(columns) * static_cast<size_t>(rows) <=
         std::max(kManyKnots, camera.size_px.PixelCount())) {
    Result<TableGrid> grid = WithIntervals(camera, columns, rows);
    if (!grid) {
      return grid;
    }
    error_px = grid->WorstErrorPx(camera);
    if (error_px <= kMaxErrorPx) {
      return grid;
    }
    columns *= 2;
    rows *= 2;
  }
  return Fail(ErrorCode::kBadData,
              "camera: the lens bends so much that positions between pixels are off by {:.2g} px; "
              "need {:.0e} px: calibrate the camera again",
              error_px, kMaxErrorPx);
}

Result<TableGrid> TableGrid::WithIntervals(const Camera& camera, int columns, int rows) {
  TableGrid grid;
  grid.size_px_ = camera.size_px;
  grid.columns_ = columns + 1;
  grid.rows_ = rows + 1;
  grid.knots_.reserve(static_cast<size_t>(grid.columns_) * static_cast<size_t>(grid.rows_));
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const double u = PixelOfKnot(column, camera.size_px.width, columns);
      const double v = PixelOfKnot(row, camera.size_px.height, rows);
      const std::optional<Eigen::Vector3d> point = TablePointOfPixel(camera, u, v);
      if (!point) {
        return NotSeen(u, v);
      }
      grid.knots_.emplace_back(point->head<2>());
    }
  }
  return grid;
}

double TableGrid::WorstErrorPx(const Camera& camera) const {
  double worst_px = 0.0;
  std::vector<Eigen::Vector2d> knots;
  for (int row = 0; row + 1 < rows_; ++row) {
    const double v = PixelOfKnot(row + 0.5, size_px_.height, rows_ - 1);
    KnotsAtRow(v, knots);
    for (int column = 0; column + 1 < columns_; ++column) {
      const Eigen::Vector2d pixel(PixelOfKnot(column + 0.5, size_px_.width, columns_ - 1), v);
      const KnotPlace place = KnotPlaceOf(pixel.x(), size_px_.width, columns_ - 1);
      const Eigen::Vector2d position =
          CubicOver(knots, static_cast<size_t>(place.first)).At(place.t);
      const Eigen::Vector2d seen_at =
          PixelOfTablePoint(camera, Eigen::Vector3d(position.x(), position.y(), 0.0));
      worst_px = std::max(worst_px, (seen_at - pixel).norm());
    }
  }
  return worst_px;
}

void TableGrid::KnotsAtRow(double v, std::vector<Eigen::Vector2d>& knots) const {
  const KnotPlace place = KnotPlaceOf(v, size_px_.height, rows_ - 1);
  knots.resize(static_cast<size_t>(columns_));
  for (size_t column = 0; column < knots.size(); ++column) {
    const size_t first = static_cast<size_t>(place.first) * knots.size() + column;
    knots[column] = CubicOver(knots_, first, knots.size()).At(place.t);
  }
}

void TableGrid::Row(int v, std::span<float> x_mm, std::span<float> y_mm) const {
  SATEEN_CHECK(v >= 0 && v < size_px_.height);
  SATEEN_CHECK(x_mm.size() == static_cast<size_t>(size_px_.width) && y_mm.size() == x_mm.size());
  std::vector<Eigen::Vector2d> knots;
  KnotsAtRow(v, knots);
  ForEachInterval(size_px_.width, columns_ - 1,
                  [&](size_t begin, size_t count, const KnotPlace& place, float step) {
                    const Cubic<Eigen::Vector2d> cubic =
                        CubicOver(knots, static_cast<size_t>(place.first));
                    FillCubic(Component(cubic, 0), place.t, step, x_mm.subspan(begin, count));
                    FillCubic(Component(cubic, 1), place.t, step, y_mm.subspan(begin, count));
                  });
}

}  // namespace sateen
