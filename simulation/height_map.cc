#include <algorithm>
#include <array>
#include <cmath>

#include "simulation/surface.h"

namespace sateen {
namespace {

// Catmull-Rom weights of the four samples around a place t in [0, 1] after the second, and their
// derivatives.
struct CubicWeights {
  std::array<double, 4> value;
  std::array<double, 4> slope;
};

CubicWeights CatmullRom(double t) {
  const double t2 = t * t;
  const double t3 = t2 * t;
  return {{0.5 * (-t3 + 2.0 * t2 - t), 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
           0.5 * (-3.0 * t3 + 4.0 * t2 + t), 0.5 * (t3 - t2)},
          {0.5 * (-3.0 * t2 + 4.0 * t - 1.0), 0.5 * (9.0 * t2 - 10.0 * t),
           0.5 * (-9.0 * t2 + 8.0 * t + 1.0), 0.5 * (3.0 * t2 - 2.0 * t)}};
}

class HeightMap final : public Surface {
 public:
  HeightMap(Image<float> height_mm, double pitch_mm)
      : height_mm_(std::move(height_mm)), pitch_mm_(pitch_mm) {
    const auto range = std::ranges::minmax(height_mm_.pixels);
    const auto low = static_cast<double>(range.min);
    const auto high = static_cast<double>(range.max);
    double step = 0.0;  // largest between neighbours
    for (int y = 0; y < height_mm_.height; ++y) {
      for (int x = 0; x < height_mm_.width; ++x) {
        step = std::max({step, std::abs(Sample(x + 1, y) - Sample(x, y)),
                         std::abs(Sample(x, y + 1) - Sample(x, y))});
      }
    }
    // Half-way the cubic's slope is -1/8, 5/4, -1/8 of three neighbouring steps s, at most 1.5 max
    // |s|; the weights across sum to at most 1.25 in magnitude; two axes. It leaves the range of
    // its samples by at most 1.25^2 - 1 of it, half on each side.
    max_slope_ = 1.5 * 1.25 * std::sqrt(2.0) * step / pitch_mm_;
    const double overshoot = 0.5 * (1.25 * 1.25 - 1.0) * (high - low);
    lowest_mm_ = low - overshoot;
    highest_mm_ = high + overshoot;
  }

  [[nodiscard]] SurfacePoint At(double x_mm, double y_mm) const override {
    const double u =
        std::clamp(x_mm / pitch_mm_ + 0.5 * (height_mm_.width - 1), -2.0, height_mm_.width + 1.0);
    const double v =
        std::clamp(0.5 * (height_mm_.height - 1) - y_mm / pitch_mm_, -2.0, height_mm_.height + 1.0);
    const int left = static_cast<int>(std::floor(u)) - 1;
    const int top = static_cast<int>(std::floor(v)) - 1;
    const CubicWeights across = CatmullRom(u - (left + 1));
    const CubicWeights down = CatmullRom(v - (top + 1));
    SurfacePoint point;
    for (int j = 0; j < 4; ++j) {
      double value = 0.0;
      double slope = 0.0;
      for (int i = 0; i < 4; ++i) {
        const double sample = Sample(left + i, top + j);
        value += across.value[static_cast<size_t>(i)] * sample;
        slope += across.slope[static_cast<size_t>(i)] * sample;
      }
      const auto row = static_cast<size_t>(j);
      point.height_mm += down.value[row] * value;
      point.slope += Eigen::Vector2d(down.value[row] * slope, -down.slope[row] * value) / pitch_mm_;
    }
    return point;
  }
  [[nodiscard]] double LowestMm() const override { return lowest_mm_; }
  [[nodiscard]] double HighestMm() const override { return highest_mm_; }
  [[nodiscard]] double MaxSlope() const override { return max_slope_; }
  [[nodiscard]] double DetailMm() const override { return pitch_mm_; }

 private:
  [[nodiscard]] double Sample(int x, int y) const {
    return static_cast<double>(height_mm_.At(std::clamp(x, 0, height_mm_.width - 1),
                                             std::clamp(y, 0, height_mm_.height - 1)));
  }

  Image<float> height_mm_;
  double pitch_mm_;
  double lowest_mm_ = 0.0;
  double highest_mm_ = 0.0;
  double max_slope_ = 0.0;
};

}  // namespace

Result<SurfacePtr> MakeHeightMap(Image<float> height_mm, double pitch_mm) {
  if (height_mm.width < 2 || height_mm.height < 2) {
    return Fail(ErrorCode::kInvalidArgument, "the height map is {}x{}; need at least 2x2",
                height_mm.width, height_mm.height);
  }
  if (!(pitch_mm >= 1e-6 && pitch_mm <= 1e6)) {
    return Fail(ErrorCode::kInvalidArgument, "pitch_mm = {:g}; need 1e-6 to 1e6", pitch_mm);
  }
  if (!std::ranges::all_of(height_mm.pixels, [](float z) { return std::isfinite(z); })) {
    return Fail(ErrorCode::kInvalidArgument, "the height map holds a value that is not finite");
  }
  return std::make_unique<HeightMap>(std::move(height_mm), pitch_mm);
}

}  // namespace sateen
