#include "rig/table_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/check.h"

namespace sateen {
namespace {

constexpr int kSpacingPx = 16;        // to begin with
constexpr int kMinIntervals = 3;      // four knots make a cubic
constexpr double kMaxErrorPx = 5e-4;  // at the middle of each cell; elsewhere up to 1.2 times it
constexpr size_t kManyKnots = 65536;  // more than these, and than pixels, are not worth it

// Where a pixel lies among the knots: the first of its four, and the distance from it in knots.
struct Place {
  int first;
  double t;  // 0 to 3; between 1 and 2 except at the image's border
};

Place PlaceOf(double pixel, int pixels, int intervals) {
  const double knot = pixels > 1 ? pixel * intervals / (pixels - 1) : 0.0;
  const int first = std::clamp(static_cast<int>(knot) - 1, 0, intervals - kMinIntervals);
  return {first, knot - first};
}

// The inverse: where knot number `knot` lies in the image.
double PixelOf(double knot, int pixels, int intervals) { return knot * (pixels - 1) / intervals; }

// The cubic through f[0..3] at t = 0..3, in Newton's form.
struct Cubic {
  Eigen::Vector2d a, b, c, d;

  explicit Cubic(std::span<const Eigen::Vector2d, 4> f)
      : a(f[0]),
        b(f[1] - f[0]),
        c((f[2] - 2.0 * f[1] + f[0]) / 2.0),
        d((f[3] - 3.0 * f[2] + 3.0 * f[1] - f[0]) / 6.0) {}
  [[nodiscard]] Eigen::Vector2d At(double t) const {
    return a + t * (b + (t - 1.0) * (c + (t - 2.0) * d));
  }
};

Cubic CubicAt(const std::vector<Eigen::Vector2d>& knots, int first) {
  return Cubic(std::span(knots).subspan(static_cast<size_t>(first)).first<4>());
}

// One coordinate at t, t + step, ... In float, which is four times as fast as double: the cubic spans
// a few millimetres, and a, to which it is added, is rounded once as any float position is.
void Fill(const Cubic& cubic, Eigen::Index coordinate, float t, float step,
          std::span<float> positions_mm) {
  const auto a = static_cast<float>(cubic.a[coordinate]);
  const auto b = static_cast<float>(cubic.b[coordinate]);
  const auto c = static_cast<float>(cubic.c[coordinate]);
  const auto d = static_cast<float>(cubic.d[coordinate]);
  const auto count = static_cast<int>(positions_mm.size());
  float* const out = positions_mm.data();
  for (int i = 0; i < count; ++i) {
    const float at = t + step * static_cast<float>(i);
    out[i] = a + at * (b + (at - 1.0F) * (c + (at - 2.0F) * d));
  }
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
  int columns = std::max(kMinIntervals, (width - 1 + kSpacingPx - 1) / kSpacingPx);
  int rows = std::max(kMinIntervals, (height - 1 + kSpacingPx - 1) / kSpacingPx);
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
      const double u = PixelOf(column, camera.size_px.width, columns);
      const double v = PixelOf(row, camera.size_px.height, rows);
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
    const double v = PixelOf(row + 0.5, size_px_.height, rows_ - 1);
    KnotsAtRow(v, knots);
    for (int column = 0; column + 1 < columns_; ++column) {
      const Eigen::Vector2d pixel(PixelOf(column + 0.5, size_px_.width, columns_ - 1), v);
      const Place place = PlaceOf(pixel.x(), size_px_.width, columns_ - 1);
      const Eigen::Vector2d position = CubicAt(knots, place.first).At(place.t);
      const Eigen::Vector2d seen_at =
          PixelOfTablePoint(camera, Eigen::Vector3d(position.x(), position.y(), 0.0));
      worst_px = std::max(worst_px, (seen_at - pixel).norm());
    }
  }
  return worst_px;
}

void TableGrid::KnotsAtRow(double v, std::vector<Eigen::Vector2d>& knots) const {
  const Place place = PlaceOf(v, size_px_.height, rows_ - 1);
  knots.resize(static_cast<size_t>(columns_));
  for (size_t column = 0; column < knots.size(); ++column) {
    std::array<Eigen::Vector2d, 4> f;
    for (size_t i = 0; i < f.size(); ++i) {
      f[i] = knots_[(static_cast<size_t>(place.first) + i) * knots.size() + column];
    }
    knots[column] = Cubic(f).At(place.t);
  }
}

void TableGrid::Row(int v, std::span<float> x_mm, std::span<float> y_mm) const {
  SATEEN_CHECK(v >= 0 && v < size_px_.height);
  SATEEN_CHECK(x_mm.size() == static_cast<size_t>(size_px_.width) && y_mm.size() == x_mm.size());
  std::vector<Eigen::Vector2d> knots;
  KnotsAtRow(v, knots);
  const int intervals = columns_ - 1;
  const float step = size_px_.width > 1
                         ? static_cast<float>(intervals) / static_cast<float>(size_px_.width - 1)
                         : 0.0F;
  int u = 0;
  for (int cell = 0; u < size_px_.width; ++cell) {
    const double cell_end =
        cell + 1 < intervals ? PixelOf(cell + 1, size_px_.width, intervals) : size_px_.width;
    const auto begin = static_cast<size_t>(u);
    const auto count = static_cast<size_t>(std::max(0, static_cast<int>(std::ceil(cell_end)) - u));
    const Place place = PlaceOf(u, size_px_.width, intervals);
    const Cubic cubic = CubicAt(knots, place.first);
    const auto t = static_cast<float>(place.t);
    Fill(cubic, 0, t, step, x_mm.subspan(begin, count));
    Fill(cubic, 1, t, step, y_mm.subspan(begin, count));
    u += static_cast<int>(count);
  }
}

}  // namespace sateen
