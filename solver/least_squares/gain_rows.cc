#include "solver/least_squares/gain_rows.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/check.h"
#include "rig/pixel_cubic.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr int kFirstSpacingPx = 16;
constexpr double kLargestError = 2e-6;  // of 1 / g, in the middle of each cell

// Returns the number of intervals. At a spacing of 1 every pixel is a knot, also where there are
// fewer pixels than a cubic has knots.
int IntervalsFor(int pixels, int spacing_px) {
  if (spacing_px == 1 && pixels == 3) {
    return 4;
  }
  return std::max(kFewestIntervals, (pixels - 1 + spacing_px - 1) / spacing_px);
}

}  // namespace

Result<GainRows> GainRows::Make(const Camera& camera, const Lights& lights) {
  for (int spacing_px = kFirstSpacingPx;; spacing_px /= 2) {
    Result<GainRows> rows =
        WithIntervals(camera, lights, IntervalsFor(camera.size_px.width, spacing_px),
                      IntervalsFor(camera.size_px.height, spacing_px));
    if (!rows || spacing_px == 1 || rows->WorstError(camera, lights) <= kLargestError) {
      return rows;
    }
  }
}

Result<GainRows> GainRows::WithIntervals(const Camera& camera, const Lights& lights, int columns,
                                         int rows) {
  GainRows grid;
  grid.size_px_ = camera.size_px;
  grid.columns_ = columns + 1;
  grid.rows_ = rows + 1;
  grid.knots_.resize(lights.size());
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const double u = PixelOfKnot(column, camera.size_px.width, columns);
      const double v = PixelOfKnot(row, camera.size_px.height, rows);
      const std::optional<Eigen::Vector3d> point = TablePointOfPixel(camera, u, v);
      if (!point) {
        return Fail(ErrorCode::kBadData,
                    "camera: pixel ({:.0f}, {:.0f}) does not see the table; calibrate the camera "
                    "again",
                    u, v);
      }
      for (size_t k = 0; k < lights.size(); ++k) {
        if (lights[k].model == LightModel::kLedField) {
          grid.knots_[k].push_back(1.0 / lights[k].field.At(point->head<2>()));
        }
      }
    }
  }
  return grid;
}

double GainRows::WorstError(const Camera& camera, const Lights& lights) const {
  double worst = 0.0;
  std::vector<std::vector<double>> knots(lights.size());
  for (int row = 0; row + 1 < rows_; ++row) {
    const double v = PixelOfKnot(row + 0.5, size_px_.height, rows_ - 1);
    for (size_t k = 0; k < lights.size(); ++k) {
      if (Has(k)) {
        KnotsAtRow(k, v, knots[k]);
      }
    }
    for (int column = 0; column + 1 < columns_; ++column) {
      const double u = PixelOfKnot(column + 0.5, size_px_.width, columns_ - 1);
      const std::optional<Eigen::Vector3d> point = TablePointOfPixel(camera, u, v);
      const KnotPlace place = KnotPlaceOf(u, size_px_.width, columns_ - 1);
      for (size_t k = 0; point && k < lights.size(); ++k) {
        if (Has(k)) {
          const double found = CubicOver(knots[k], static_cast<size_t>(place.first)).At(place.t);
          worst = std::max(worst, std::abs(found * lights[k].field.At(point->head<2>()) - 1.0));
        }
      }
    }
  }
  return worst;
}

void GainRows::KnotsAtRow(size_t light, double v, std::vector<double>& knots) const {
  const KnotPlace place = KnotPlaceOf(v, size_px_.height, rows_ - 1);
  knots.resize(static_cast<size_t>(columns_));
  for (size_t column = 0; column < knots.size(); ++column) {
    const size_t first = static_cast<size_t>(place.first) * knots.size() + column;
    knots[column] = CubicOver(knots_[light], first, knots.size()).At(place.t);
  }
}

void GainRows::Row(size_t light, int v, std::span<float> inverse_gains) const {
  SATEEN_CHECK(v >= 0 && v < size_px_.height);
  SATEEN_CHECK(inverse_gains.size() == static_cast<size_t>(size_px_.width));
  std::vector<double> knots;
  KnotsAtRow(light, v, knots);
  ForEachInterval(size_px_.width, columns_ - 1,
                  [&](size_t begin, size_t count, const KnotPlace& place, float step) {
                    FillCubic(CubicOver(knots, static_cast<size_t>(place.first)), place.t, step,
                              inverse_gains.subspan(begin, count));
                  });
}

}  // namespace sateen
