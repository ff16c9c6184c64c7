#include "targets/marker_dictionary.h"

#include <algorithm>
#include <array>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>

#include "core/check.h"

namespace sateen {
namespace {

constexpr std::array kDictionarySizes = {50, 100, 250, 1000};
constexpr int kFewestBits = 4;
constexpr int kMostBits = 7;

cv::Ptr<cv::aruco::Dictionary> DictionaryOf(const std::string& name) {
  const Result<int> number = DictionaryNumber(name);
  SATEEN_CHECK(number.has_value());
  return cv::aruco::getPredefinedDictionary(*number);
}

}  // namespace

Result<int> DictionaryNumber(const std::string& dictionary) {
  int number = cv::aruco::DICT_4X4_50;
  for (int bits = kFewestBits; bits <= kMostBits; ++bits) {
    for (const int size : kDictionarySizes) {
      if (dictionary == fmt::format("DICT_{}X{}_{}", bits, bits, size)) {
        return number;
      }
      ++number;
    }
  }
  if (dictionary == "DICT_ARUCO_ORIGINAL") {
    return cv::aruco::DICT_ARUCO_ORIGINAL;
  }
  return Fail(ErrorCode::kInvalidArgument,
              "no dictionary '{}'; need DICT_4X4_50, _100, _250, _1000, the same of 5X5, 6X6, "
              "7X7, or DICT_ARUCO_ORIGINAL",
              dictionary);
}

Result<int> MarkerCount(const std::string& dictionary) {
  return DictionaryNumber(dictionary).map([](int number) {
    return cv::aruco::getPredefinedDictionary(number)->bytesList.rows;
  });
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

}  // namespace sateen
