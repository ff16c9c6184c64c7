#include "imaging/show/canvas.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace sateen {
namespace {

constexpr int kShift = 4;  // fractional bits of OpenCV's coordinates
constexpr int kCaptionPx = 22;
constexpr double kTextScale = 0.55;

cv::Point PointOf(const Eigen::Vector2d& at) {
  const double most = 1e6;  // far outside, and no overflow
  const auto coordinate = [&](double value) {
    return static_cast<int>(std::lround(std::clamp(value, -most, most) * (1 << kShift)));
  };
  return {coordinate(at.x()), coordinate(at.y())};
}

cv::Scalar ScalarOf(const Color8& ink) { return {double(ink[0]), double(ink[1]), double(ink[2])}; }

cv::Mat MatOf(std::vector<uint8_t>& pixels, int width, int height) {
  return {height, width, CV_8UC3, pixels.data()};
}

}  // namespace

Color8 DistinctColor(size_t i) {
  constexpr std::array<Color8, 10> kColors = {{{255, 110, 90},
                                               {90, 200, 255},
                                               {150, 230, 90},
                                               {255, 200, 70},
                                               {200, 130, 255},
                                               {80, 230, 190},
                                               {255, 130, 200},
                                               {130, 150, 255},
                                               {230, 230, 110},
                                               {240, 160, 110}}};
  return kColors[i % kColors.size()];
}

Canvas::Canvas(int width, int height, const Color8& paper)
    : width_(width),
      height_(height),
      pixels_(3 * static_cast<size_t>(width) * static_cast<size_t>(height)) {
  for (size_t i = 0; i < pixels_.size(); ++i) {
    pixels_[i] = paper[i % 3];
  }
}

void Canvas::Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Color8& ink,
                  int thickness_px) {
  cv::Mat mat = MatOf(pixels_, width_, height_);
  cv::line(mat, PointOf(a), PointOf(b), ScalarOf(ink), thickness_px, cv::LINE_AA, kShift);
}

void Canvas::Dot(const Eigen::Vector2d& at, int radius_px, const Color8& ink) {
  cv::Mat mat = MatOf(pixels_, width_, height_);
  cv::circle(mat, PointOf(at), radius_px << kShift, ScalarOf(ink), cv::FILLED, cv::LINE_AA, kShift);
}

void Canvas::Box(int x, int y, int width, int height, const Color8& ink) {
  cv::Mat mat = MatOf(pixels_, width_, height_);
  cv::rectangle(mat, cv::Rect(x, y, width, height), ScalarOf(ink), cv::FILLED);
}

void Canvas::Text(const Eigen::Vector2d& at, const std::string& text, const Color8& ink,
                  double widest_px) {
  int below_px = 0;
  const double width_px =
      cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, kTextScale, 1, &below_px).width;
  const double scale = kTextScale * std::min(1.0, widest_px / width_px);
  cv::Mat mat = MatOf(pixels_, width_, height_);
  cv::putText(mat, text,
              {static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y()))},
              cv::FONT_HERSHEY_SIMPLEX, scale, ScalarOf(ink), 1, cv::LINE_AA);
}

void Canvas::Place(const Rgb8& picture, int x, int y) {
  for (int v = 0; v < std::min(picture[0].height, height_ - y); ++v) {
    for (int u = 0; u < std::min(picture[0].width, width_ - x); ++u) {
      for (size_t c = 0; c < 3; ++c) {
        const auto pixel =
            static_cast<size_t>(y + v) * static_cast<size_t>(width_) + static_cast<size_t>(x + u);
        pixels_[3 * pixel + c] = picture[c].At(u, v);
      }
    }
  }
}

Rgb8 Canvas::Taken() const {
  Rgb8 picture = {Image<uint8_t>(width_, height_), Image<uint8_t>(width_, height_),
                  Image<uint8_t>(width_, height_)};
  for (size_t i = 0; i < pixels_.size(); ++i) {
    picture[i % 3].pixels[i / 3] = pixels_[i];
  }
  return picture;
}

Rgb8 Captioned(const Rgb8& panel, const std::string& caption) {
  Canvas canvas(panel[0].width, panel[0].height + kCaptionPx, kWhiteInk);
  canvas.Place(panel, 0, 0);
  canvas.Text({2.0, panel[0].height + 0.75 * kCaptionPx}, caption, kBlackInk, panel[0].width - 4.0);
  return canvas.Taken();
}

std::string HeatCaption(const std::string& what, float white, const std::string& unit) {
  return fmt::format("{}, white = {:.2g}{}{}", what, white, unit.empty() ? "" : " ", unit);
}

Rgb8 ScaledGrey(const Image<uint8_t>& grey, double factor) {
  const cv::Mat mat(grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data()));
  cv::Mat scaled;
  cv::resize(mat, scaled, {}, factor, factor, factor < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  Image<uint8_t> plane(scaled.cols, scaled.rows);
  for (int y = 0; y < scaled.rows; ++y) {
    std::copy_n(scaled.ptr<uint8_t>(y), scaled.cols, &plane.At(0, y));
  }
  return {plane, plane, plane};
}

}  // namespace sateen
