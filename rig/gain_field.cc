#include "rig/gain_field.h"

#include <algorithm>
#include <cmath>

#include "core/whole_number.h"
#include "rig/plausible.h"

namespace sateen {
namespace {

constexpr int kFewestKnots = 4;
constexpr double kLeastGain = 1e-9;
constexpr double kMostGain = 100.0;
constexpr double kLeastFall = 1e-3;  // share of the light's height

// The four B of equation (1) at t from 0 to 1 within a cell, and their derivatives by t.
struct Cell {
  int first = 0;  // knot
  std::array<double, 4> b = {};
  std::array<double, 4> slope = {};
};

Cell CellAt(double at, int knots) {
  const double inside = std::clamp(at, 1.0, knots - 2.0);
  // A place that is no number, as of a light that a fit has lost, is in the first cell.
  const int cell = std::clamp(ClampedTo<int>(inside), 1, knots - 3);
  const double t = inside - cell;
  const double s = 1.0 - t;
  Cell result{.first = cell - 1,
              .b = {s * s * s / 6.0, (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
                    (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0, t * t * t / 6.0}};
  if (inside == at) {  // beyond the border the gain does not change
    result.slope = {-0.5 * s * s, 1.5 * t * t - 2.0 * t, 2.0 * s - 1.5 * s * s, 0.5 * t * t};
  }
  return result;
}

}  // namespace

GainField::Weights GainField::WeightsAt(const Eigen::Vector2d& x_mm) const {
  const Eigen::Vector2d at = (x_mm - origin_mm) / spacing_mm;
  const Cell x = CellAt(at.x(), columns);
  const Cell y = CellAt(at.y(), rows);
  Weights weights{.first = static_cast<size_t>(y.first) * static_cast<size_t>(columns) +
                           static_cast<size_t>(x.first)};
  for (size_t r = 0; r < 4; ++r) {
    for (size_t c = 0; c < 4; ++c) {
      weights.value[4 * r + c] = y.b[r] * x.b[c];
      weights.along_x[4 * r + c] = y.b[r] * x.slope[c] / spacing_mm;
      weights.along_y[4 * r + c] = y.slope[r] * x.b[c] / spacing_mm;
    }
  }
  return weights;
}

double GainField::At(const Eigen::Vector2d& x_mm) const {
  const Eigen::Vector2d at = (x_mm - origin_mm) / spacing_mm;
  const Cell x = CellAt(at.x(), columns);
  const Cell y = CellAt(at.y(), rows);
  double sum = 0.0;
  for (size_t r = 0; r < 4; ++r) {
    const double* const row = gain.data() +
                              (static_cast<size_t>(y.first) + r) * static_cast<size_t>(columns) +
                              static_cast<size_t>(x.first);
    sum += y.b[r] * (x.b[0] * row[0] + x.b[1] * row[1] + x.b[2] * row[2] + x.b[3] * row[3]);
  }
  return sum;
}

Status GainField::Validate(std::string_view what) const {
  if (!origin_mm.allFinite()) {
    return Fail(ErrorCode::kBadData, "{}: origin_mm is [{:g}, {:g}]; need finite numbers", what,
                origin_mm.x(), origin_mm.y());
  }
  Status place =
      CheckPlausible(what, ": origin_mm", {origin_mm.x(), origin_mm.y()}, kPlausiblePlace);
  if (place && !(spacing_mm > 0.0)) {
    place =
        Fail(ErrorCode::kBadData, "{}: spacing_mm is {:g}; need a number > 0", what, spacing_mm);
  }
  if (place) {
    place = CheckPlausible(what, ": spacing_mm", {spacing_mm}, kPlausibleSpacing);
  }
  if (!place) {
    return place;
  }
  if (std::min(columns, rows) < kFewestKnots || std::max(columns, rows) > kMostFieldKnots) {
    return Fail(ErrorCode::kBadData, "{}: has {} columns and {} rows; need {} to {} of each", what,
                columns, rows, kFewestKnots, kMostFieldKnots);
  }
  if (gain.size() != static_cast<size_t>(columns) * static_cast<size_t>(rows)) {
    return Fail(ErrorCode::kBadData, "{}: has {} gains; need {} columns x {} rows = {}", what,
                gain.size(), columns, rows, columns * rows);
  }
  for (const double value : gain) {
    if (!(value >= kLeastGain && value <= kMostGain)) {
      return Fail(ErrorCode::kBadData, "{}: a gain is {:g}; need above 0 and up to {:g}", what,
                  value, kMostGain);
    }
  }
  return {};
}

Eigen::Vector2d ShadowOnTable(const Eigen::Vector3d& light_mm, const Eigen::Vector3d& x_mm) {
  const double fall_mm = std::max(light_mm.z() - x_mm.z(), kLeastFall * light_mm.z());
  return light_mm.head<2>() + (x_mm - light_mm).head<2>() * (light_mm.z() / fall_mm);
}

}  // namespace sateen
