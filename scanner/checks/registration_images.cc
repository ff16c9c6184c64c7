#include "scanner/checks/registration_images.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "scanner/sessions/frames/frame_shift.h"

namespace sateen {

Image<float> Halved(const Image<float>& image) {
  Image<float> half(image.width / 2, image.height / 2);
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      half.At(x, y) = 0.25F * (image.At(2 * x, 2 * y) + image.At(2 * x + 1, 2 * y) +
                               image.At(2 * x, 2 * y + 1) + image.At(2 * x + 1, 2 * y + 1));
    }
  }
  return half;
}

Image<float> HighPassed(const Image<float>& image) {
  constexpr int kBlurCells = 4;
  const int width = image.width;
  // Sums and counts of all above and left of a place.
  std::vector<double> sums(static_cast<size_t>(width + 1) * static_cast<size_t>(image.height + 1));
  std::vector<int> counts(sums.size());
  const auto at = [&](int x, int y) {
    return static_cast<size_t>(y) * static_cast<size_t>(width + 1) + static_cast<size_t>(x);
  };
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float value = image.At(x, y);
      const bool is_known = std::isfinite(value);
      sums[at(x + 1, y + 1)] = sums[at(x, y + 1)] + sums[at(x + 1, y)] - sums[at(x, y)] +
                               (is_known ? static_cast<double>(value) : 0.0);
      counts[at(x + 1, y + 1)] =
          counts[at(x, y + 1)] + counts[at(x + 1, y)] - counts[at(x, y)] + (is_known ? 1 : 0);
    }
  }
  Image<float> high = image;
  for (int y = 0; y < image.height; ++y) {
    const int y0 = std::max(0, y - kBlurCells);
    const int y1 = std::min(image.height, y + kBlurCells + 1);
    for (int x = 0; x < width; ++x) {
      const int x0 = std::max(0, x - kBlurCells);
      const int x1 = std::min(width, x + kBlurCells + 1);
      const auto over = [&](const auto& table) {
        return table[at(x1, y1)] - table[at(x0, y1)] - table[at(x1, y0)] + table[at(x0, y0)];
      };
      high.At(x, y) -= static_cast<float>(over(sums) / std::max(over(counts), 1));
    }
  }
  return high;
}

Image<float> Moved(const Image<float>& image, const Eigen::Vector2d& shift) {
  if (shift.isZero()) {
    return image;
  }
  const LanczosWindow along_x = LanczosAt(shift.x());
  const LanczosWindow along_y = LanczosAt(shift.y());
  const auto taps = static_cast<int>(along_x.weights.size());
  Image<float> rows(image.width, image.height, std::numeric_limits<float>::quiet_NaN());
  const int right = std::min(image.width, image.width - along_x.first - taps + 1);
  for (int y = 0; y < image.height; ++y) {
    for (int x = std::max(0, -along_x.first); x < right; ++x) {
      const float* at = &image.At(x + along_x.first, y);
      float sum = 0.0F;
      for (size_t m = 0; m < along_x.weights.size(); ++m) {
        sum += along_x.weights[m] * at[m];
      }
      rows.At(x, y) = sum;
    }
  }
  Image<float> moved(image.width, image.height, std::numeric_limits<float>::quiet_NaN());
  const auto width = static_cast<size_t>(image.width);
  const int bottom = std::min(image.height, image.height - along_y.first - taps + 1);
  for (int y = std::max(0, -along_y.first); y < bottom; ++y) {
    const float* above = &rows.At(0, y + along_y.first);
    for (size_t x = 0; x < width; ++x) {
      float sum = 0.0F;
      for (size_t m = 0; m < along_y.weights.size(); ++m) {
        sum += along_y.weights[m] * above[x + m * width];
      }
      moved.At(static_cast<int>(x), y) = sum;
    }
  }
  return moved;
}

}  // namespace sateen
