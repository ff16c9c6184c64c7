#include "scanner/sessions/frames/frame_shift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace sateen {
namespace {

constexpr int kTaps = 6;
constexpr double kLeastWeight = 1e-7;

double Sinc(double t) {
  const double x = std::numbers::pi * t;
  return std::abs(x) < 1e-9 ? 1.0 : std::sin(x) / x;
}

int MirroredPlace(int i, int count) {
  if (count == 1) {
    return 0;
  }
  const int period = 2 * (count - 1);
  i = ((i % period) + period) % period;
  return i < count ? i : period - i;
}

// One line of samples, `stride` apart.
struct Line {
  float* samples;
  int count;
  size_t stride;
  float& operator[](int i) const { return samples[static_cast<size_t>(i) * stride]; }
};

void Resample(const LanczosWindow& window, double shift, float full_scale, const Line& line,
              std::vector<float>& copy) {
  copy.resize(static_cast<size_t>(line.count));
  for (int i = 0; i < line.count; ++i) {
    copy[static_cast<size_t>(i)] = line[i];
  }
  for (int i = 0; i < line.count; ++i) {
    const double place = i + shift;
    if (place < -0.5 || place > line.count - 0.5) {
      line[i] = std::numeric_limits<float>::quiet_NaN();
      continue;
    }
    float sum = 0.0F;
    bool saturated = false;
    for (int m = 0; m < kTaps; ++m) {
      const float w = window.weights[static_cast<size_t>(m)];
      const float value =
          copy[static_cast<size_t>(MirroredPlace(i + window.first + m, line.count))];
      saturated = saturated || (w != 0.0F && value >= full_scale);
      sum += w * value;
    }
    // Overshoot beside an edge is no saturation.
    line[i] = saturated ? full_scale : std::min(sum, std::nextafter(full_scale, 0.0F));
  }
}

}  // namespace

LanczosWindow LanczosAt(double shift) {
  LanczosWindow window{.first = static_cast<int>(std::floor(shift)) - kTaps / 2 + 1};
  std::array<double, kTaps> h = {};
  double sum = 0.0;
  for (int m = 0; m < kTaps; ++m) {
    const double t = shift - (window.first + m);
    h[static_cast<size_t>(m)] = Sinc(t) * Sinc(t / 3.0);  // (1)
    sum += h[static_cast<size_t>(m)];
  }
  // Rounding leaves 4e-17 where a whole shift has no weight at all. It must not saturate a sample.
  std::ranges::transform(h, window.weights.begin(), [&](double w) {
    return std::abs(w) < kLeastWeight ? 0.0F : static_cast<float>(w / sum);
  });
  return window;
}

void LayOverFirst(const Eigen::Vector2d& shift_px, LightFrame& frame) {
  if (shift_px.isZero()) {
    return;
  }
  const LanczosWindow along_x = LanczosAt(shift_px.x());
  const LanczosWindow along_y = LanczosAt(shift_px.y());
  std::vector<float> copy;
  for (Image<float>& plane : frame.rgb.planes) {
    const auto width = static_cast<size_t>(plane.width);
    for (int y = 0; y < plane.height && shift_px.x() != 0.0; ++y) {
      Resample(along_x, shift_px.x(), frame.full_scale, {&plane.At(0, y), plane.width, 1}, copy);
    }
    for (int x = 0; x < plane.width && shift_px.y() != 0.0; ++x) {
      Resample(along_y, shift_px.y(), frame.full_scale, {&plane.At(x, 0), plane.height, width},
               copy);
    }
  }
}

}  // namespace sateen
