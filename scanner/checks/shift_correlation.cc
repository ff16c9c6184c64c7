#include "scanner/checks/shift_correlation.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace sateen {
namespace {

constexpr double kHighPassPx = 3.0;  // standard deviation of what is taken out

// Returns the mean of the finite cells; 0 if none is finite.
float MeanOfFinite(const Image<float>& image) {
  double sum = 0.0;
  double count = 0.0;
  for (const float value : image.pixels) {
    sum += std::isfinite(value) ? static_cast<double>(value) : 0.0;
    count += std::isfinite(value) ? 1.0 : 0.0;
  }
  return static_cast<float>(sum / std::max(count, 1.0));
}

// Returns the texture alone, fading out towards the border, which wraps around.
cv::Mat TextureOf(const Image<float>& image) {
  cv::Mat values(image.height, image.width, CV_32F);
  const float mean = MeanOfFinite(image);
  std::ranges::transform(image.pixels, values.begin<float>(),
                         [&](float value) { return std::isfinite(value) ? value : mean; });
  cv::Mat smooth;
  cv::GaussianBlur(values, smooth, cv::Size(), kHighPassPx);
  cv::Mat high;
  cv::Mat(values - smooth).convertTo(high, CV_64F);
  cv::Mat window;
  cv::createHanningWindow(window, high.size(), CV_64F);
  return high.mul(window);
}

// Returns where the parabola through three values, 1 apart, is highest, from the middle one.
double TopOfParabola(double before, double middle, double after) {
  const double curvature = before - 2.0 * middle + after;
  return curvature < 0.0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

}  // namespace

Correlation ShiftBetween(const Image<float>& first, const Image<float>& second) {
  constexpr int kFewestCells = 16;
  if (first.Size() != second.Size() || std::min(first.width, first.height) < kFewestCells) {
    return {};
  }
  const cv::Mat f = TextureOf(first);
  const cv::Mat g = TextureOf(second);
  const double scale = cv::norm(f) * cv::norm(g);
  if (scale == 0.0) {
    return {};
  }
  cv::Mat spectrum_f;
  cv::Mat spectrum_g;
  cv::dft(f, spectrum_f);
  cv::dft(g, spectrum_g);
  cv::Mat product;
  cv::mulSpectrums(spectrum_g, spectrum_f, product, 0, /*conjB=*/true);
  cv::Mat correlation;  // function of shift (x, y), both modulo the size
  cv::idft(product, correlation, cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
  double peak = 0.0;
  cv::Point at;
  cv::minMaxLoc(correlation, nullptr, &peak, nullptr, &at);
  const auto value = [&](int dx, int dy) {
    return correlation.at<double>((at.y + dy + first.height) % first.height,
                                  (at.x + dx + first.width) % first.width);
  };
  const Eigen::Vector2d cells((at.x > first.width / 2 ? at.x - first.width : at.x) +
                                  TopOfParabola(value(-1, 0), peak, value(1, 0)),
                              (at.y > first.height / 2 ? at.y - first.height : at.y) +
                                  TopOfParabola(value(0, -1), peak, value(0, 1)));
  return {.px = 2.0 * cells, .peak = peak / scale};  // a cell is two pixels
}

}  // namespace sateen
