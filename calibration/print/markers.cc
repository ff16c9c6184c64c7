#include "calibration/print/markers.h"

#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "targets/marker_dictionary.h"

namespace sateen {
namespace {

constexpr int kWidestForMarkersPx = 2500;  // wider pictures are shrunk to find markers in them

constexpr double kSmoothingPx = 1.0;  // standard deviation

// Wraps our pixels, which OpenCV must not change.
cv::Mat MatOfGrey(const Image<uint8_t>& grey) {
  return {grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data())};
}

}  // namespace

std::vector<MarkerView> FindMarkers(const Image<uint8_t>& grey, const std::string& dictionary) {
  const double shrink = std::max(1.0, static_cast<double>(grey.width) / kWidestForMarkersPx);
  cv::Mat small = MatOfGrey(grey);
  if (shrink > 1.0) {
    cv::resize(small, small, {}, 1.0 / shrink, 1.0 / shrink, cv::INTER_AREA);
  }
  const Result<int> number = DictionaryNumber(dictionary);
  SATEEN_CHECK(number.has_value());
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(small, cv::aruco::getPredefinedDictionary(*number), corners, ids);

  std::vector<MarkerView> views;
  views.reserve(ids.size());
  for (size_t i = 0; i < ids.size(); ++i) {
    if (std::count(ids.begin(), ids.end(), ids[i]) > 1) {
      continue;
    }
    MarkerView view = {.id = ids[i]};
    for (size_t c = 0; c < 4; ++c) {
      view.corners_px[c] = {(static_cast<double>(corners[i][c].x) + 0.5) * shrink - 0.5,
                            (static_cast<double>(corners[i][c].y) + 0.5) * shrink - 0.5};
    }
    views.push_back(view);
  }
  std::sort(views.begin(), views.end(),
            [](const MarkerView& a, const MarkerView& b) { return a.id < b.id; });
  return views;
}

Image<uint8_t> SmoothedForCorners(const Image<uint8_t>& grey) {
  Image<uint8_t> smooth(grey.Size());
  cv::Mat result(grey.height, grey.width, CV_8UC1, smooth.pixels.data());
  cv::GaussianBlur(MatOfGrey(grey), result, {}, kSmoothingPx);
  return smooth;
}

Eigen::Vector2d RefineCorner(const Image<uint8_t>& smooth, const Eigen::Vector2d& at_px,
                             int half_window_px) {
  const double margin = half_window_px + 1.0;
  if (!(at_px.x() >= margin && at_px.y() >= margin && at_px.x() < smooth.width - 1 - margin &&
        at_px.y() < smooth.height - 1 - margin)) {
    return at_px;
  }
  std::vector<cv::Point2f> corner = {
      {static_cast<float>(at_px.x()), static_cast<float>(at_px.y())}};
  cv::cornerSubPix(MatOfGrey(smooth), corner, {half_window_px, half_window_px}, {-1, -1},
                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-4});
  return {corner[0].x, corner[0].y};
}

}  // namespace sateen
