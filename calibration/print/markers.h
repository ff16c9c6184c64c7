#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// A square marker of an ArUco dictionary as a picture shows it.
struct MarkerView {
  int id = 0;
  // Top left, top right, bottom right and bottom left of the marker as printed, to about a pixel.
  std::array<Eigen::Vector2d, 4> corners_px = {};
};

// Finds markers, in order of their ids. An id that is seen twice is left out.
[[nodiscard]] std::vector<MarkerView> FindMarkers(const Image<uint8_t>& grey,
                                                  const std::string& dictionary);

// Smooths the picture for RefineCorner(). Edges as sharp as a pixel pull corners towards the middle
// of pixels by up to 0.1 px; smoothing halves that.
[[nodiscard]] Image<uint8_t> SmoothedForCorners(const Image<uint8_t>& grey);

// Returns the crossing of edges next to `at_px`, to a few hundredths of a pixel, from the square of
// 2 half_window_px + 1 pixels about it. Returns `at_px` where that square is not in the picture.
[[nodiscard]] Eigen::Vector2d RefineCorner(const Image<uint8_t>& smooth,
                                           const Eigen::Vector2d& at_px, int half_window_px);

}  // namespace sateen
