#pragma once

// Cubic interpolation over the pixels of an image from knots at equal intervals of it; for .cc
// files.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace sateen {

inline constexpr int kFewestIntervals = 3;  // four knots make a cubic

// Where a pixel lies among the knots: the first of its four, and the distance from it in knots.
struct KnotPlace {
  int first;
  double t;  // 0 to 3; between 1 and 2 except at the image's border
};

inline KnotPlace KnotPlaceOf(double pixel, int pixels, int intervals) {
  const double knot = pixels > 1 ? pixel * intervals / (pixels - 1) : 0.0;
  const int first = std::clamp(static_cast<int>(knot) - 1, 0, intervals - kFewestIntervals);
  return {first, knot - first};
}

// Returns the inverse: where knot number `knot` lies in the image.
inline double PixelOfKnot(double knot, int pixels, int intervals) {
  return knot * (pixels - 1) / intervals;
}

// The cubic through f[0..3] at t = 0..3, in Newton's form. Value: double, or a vector of it.
template <typename Value>
struct Cubic {
  Value a, b, c, d;

  Cubic() = default;
  explicit Cubic(std::span<const Value, 4> f)
      : a(f[0]),
        b(f[1] - f[0]),
        c((f[2] - 2.0 * f[1] + f[0]) / 2.0),
        d((f[3] - 3.0 * f[2] + 3.0 * f[1] - f[0]) / 6.0) {}
  [[nodiscard]] Value At(double t) const { return a + t * (b + (t - 1.0) * (c + (t - 2.0) * d)); }
};

// The four knots of one line of a grid, `stride` apart from `knots[at]` on.
template <typename Value>
Cubic<Value> CubicOver(const std::vector<Value>& knots, size_t at, size_t stride = 1) {
  const std::array<Value, 4> f = {knots[at], knots[at + stride], knots[at + 2 * stride],
                                  knots[at + 3 * stride]};
  return Cubic<Value>(f);
}

// Fills in the values at t, t + step, ... In float, which is four times as fast as double: the
// cubic spans little, and a, to which it is added, is rounded once as any float is.
inline void FillCubic(const Cubic<double>& cubic, double from, float step,
                      std::span<float> values) {
  const auto a = static_cast<float>(cubic.a);
  const auto b = static_cast<float>(cubic.b);
  const auto c = static_cast<float>(cubic.c);
  const auto d = static_cast<float>(cubic.d);
  const auto t = static_cast<float>(from);
  const auto count = static_cast<int>(values.size());
  float* const out = values.data();
  for (int i = 0; i < count; ++i) {
    const float at = t + step * static_cast<float>(i);
    out[i] = a + at * (b + (at - 1.0F) * (c + (at - 2.0F) * d));
  }
}

// Calls fill(first pixel, count, place of that pixel, step in knots) for each interval of a row.
template <typename Fill>
void ForEachInterval(int pixels, int intervals, const Fill& fill) {
  const float step =
      pixels > 1 ? static_cast<float>(intervals) / static_cast<float>(pixels - 1) : 0.0F;
  int u = 0;
  for (int cell = 0; u < pixels; ++cell) {
    const double end = cell + 1 < intervals ? PixelOfKnot(cell + 1, pixels, intervals) : pixels;
    const int count = std::max(0, static_cast<int>(std::ceil(end)) - u);
    fill(static_cast<size_t>(u), static_cast<size_t>(count), KnotPlaceOf(u, pixels, intervals),
         step);
    u += count;
  }
}

}  // namespace sateen
