#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

inline constexpr int kMostFieldKnots = 256;  // along one side

/// A smooth gain over the table, close to 1: what a lamp's lens adds to the law of its rung.
///
///     g(x, y) = sum_rc gain[r columns + c] B((x - x_0) / h - c) B((y - y_0) / h - r)          (1)
///
/// with the uniform cubic B-spline B (support -2 to 2, twice continuously differentiable),
/// origin_mm (x_0, y_0) and spacing_mm h. The B of all knots add up to 1 from the second knot to
/// the last but one; a point beyond has the gain of the nearest point of that rectangle.
struct GainField {
  Eigen::Vector2d origin_mm = Eigen::Vector2d::Zero();  // the first knot; rows go up with y
  double spacing_mm = 1.0;
  int columns = 0;
  int rows = 0;
  std::vector<double> gain;  // columns x rows coefficients, row by row

  // The 4 x 4 knots that a point has part in: the index of the first, and the weights of (1) with
  // their derivatives along x and y [1/mm], row by row.
  struct Weights {
    size_t first = 0;
    std::array<double, 16> value;
    std::array<double, 16> along_x;
    std::array<double, 16> along_y;
  };
  [[nodiscard]] Weights WeightsAt(const Eigen::Vector2d& x_mm) const;

  [[nodiscard]] double At(const Eigen::Vector2d& x_mm) const;

  // Fails with kBadData, which names the first field out of range: finite numbers, spacing > 0, 4
  // to kMostFieldKnots columns and rows, as many gains, each above 0 and up to 100. `what` opens
  // the message.
  [[nodiscard]] Status Validate(std::string_view what) const;

  bool operator==(const GainField&) const = default;
};

/// Returns where the ray from a light through x meets the table plane z = 0. A lamp that is small
/// beside its distance sends out so much in each direction, and how much does not depend on how far
/// along the ray a surface is met; so a gain that is known on the plane is known everywhere. A ray
/// that does not come down meets the plane far away on its side.
[[nodiscard]] Eigen::Vector2d ShadowOnTable(const Eigen::Vector3d& light_mm,
                                            const Eigen::Vector3d& x_mm);

}  // namespace sateen
