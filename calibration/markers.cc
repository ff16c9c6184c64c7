#include "calibration/markers.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/check.h"

namespace sateen {
namespace {

constexpr int kWidestForMarkersPx = 2500;  // wider pictures are shrunk to find markers in them
constexpr std::array kDictionarySizes = {50, 100, 250, 1000};

const std::map<std::string, cv::aruco::PREDEFINED_DICTIONARY_NAME>& DictionaryNames() {
  static const auto* names = [] {
    auto* made = new std::map<std::string, cv::aruco::PREDEFINED_DICTIONARY_NAME>;
    int name = cv::aruco::DICT_4X4_50;
    for (int bits = 4; bits <= 7; ++bits) {
      for (const int size : kDictionarySizes) {
        (*made)[fmt::format("DICT_{}X{}_{}", bits, bits, size)] =
            static_cast<cv::aruco::PREDEFINED_DICTIONARY_NAME>(name++);
      }
    }
    (*made)["DICT_ARUCO_ORIGINAL"] = cv::aruco::DICT_ARUCO_ORIGINAL;
    return made;
  }();
  return *names;
}

cv::Ptr<cv::aruco::Dictionary> DictionaryOf(const std::string& name) {
  const auto found = DictionaryNames().find(name);
  SATEEN_CHECK(found != DictionaryNames().end());
  return cv::aruco::getPredefinedDictionary(found->second);
}

// A view of our pixels; OpenCV has no constant one.
cv::Mat MatOfGrey(const Image<uint8_t>& grey) {
  return {grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data())};
}

}  // namespace

Result<int> MarkerCount(const std::string& dictionary) {
  if (!DictionaryNames().contains(dictionary)) {
    return Fail(ErrorCode::kInvalidArgument,
                "no dictionary '{}'; need DICT_4X4_50, _100, _250, _1000, the same of 5X5, 6X6, "
                "7X7, or DICT_ARUCO_ORIGINAL",
                dictionary);
  }
  return DictionaryOf(dictionary)->bytesList.rows;
}

std::string DictionaryFor(int bits, int count) {
  const auto* const enough = std::find_if(kDictionarySizes.begin(), kDictionarySizes.end() - 1,
                                          [&](int size) { return size >= count; });
  return fmt::format("DICT_{}X{}_{}", bits, bits, *enough);
}

Image<uint8_t> MarkerCells(const std::string& dictionary, int id) {
  const cv::Ptr<cv::aruco::Dictionary> markers = DictionaryOf(dictionary);
  const cv::Mat bits =
      cv::aruco::Dictionary::getBitsFromByteList(markers->bytesList.row(id), markers->markerSize);
  Image<uint8_t> cells(markers->markerSize + 2, markers->markerSize + 2);
  for (int y = 0; y < bits.rows; ++y) {
    for (int x = 0; x < bits.cols; ++x) {
      cells.At(x + 1, y + 1) = bits.at<uint8_t>(y, x);
    }
  }
  return cells;
}

std::vector<MarkerView> FindMarkers(const Image<uint8_t>& grey, const std::string& dictionary) {
  const double shrink = std::max(1.0, static_cast<double>(grey.width) / kWidestForMarkersPx);
  cv::Mat small = MatOfGrey(grey);
  if (shrink > 1.0) {
    cv::resize(small, small, {}, 1.0 / shrink, 1.0 / shrink, cv::INTER_AREA);
  }
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(small, DictionaryOf(dictionary), corners, ids);

  std::vector<MarkerView> views;
  views.reserve(ids.size());
  for (size_t i = 0; i < ids.size(); ++i) {
    if (std::count(ids.begin(), ids.end(), ids[i]) > 1) {
      continue;
    }
    MarkerView view = {.id = ids[i]};
    for (size_t c = 0; c < 4; ++c) {
      view.corners_px[c] = {(corners[i][c].x + 0.5) * shrink - 0.5,
                            (corners[i][c].y + 0.5) * shrink - 0.5};
    }
    views.push_back(view);
  }
  std::sort(views.begin(), views.end(),
            [](const MarkerView& a, const MarkerView& b) { return a.id < b.id; });
  return views;
}

Eigen::Vector2d RefineCorner(const Image<uint8_t>& grey, const Eigen::Vector2d& at_px,
                             int half_window_px) {
  const double margin = half_window_px + 1.0;
  if (!(at_px.x() >= margin && at_px.y() >= margin && at_px.x() < grey.width - 1 - margin &&
        at_px.y() < grey.height - 1 - margin)) {
    return at_px;
  }
  std::vector<cv::Point2f> corner = {
      {static_cast<float>(at_px.x()), static_cast<float>(at_px.y())}};
  cv::cornerSubPix(MatOfGrey(grey), corner, {half_window_px, half_window_px}, {-1, -1},
                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-4});
  return {corner[0].x, corner[0].y};
}

}  // namespace sateen
