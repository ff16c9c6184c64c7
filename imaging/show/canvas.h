#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "imaging/show/pictures.h"

namespace sateen {

using Color8 = std::array<uint8_t, 3>;  // red, green, blue

inline constexpr Color8 kWhiteInk = {255, 255, 255};
inline constexpr Color8 kBlackInk = {20, 20, 20};
inline constexpr Color8 kGreyInk = {150, 150, 150};
inline constexpr Color8 kRedInk = {255, 70, 60};
inline constexpr Color8 kGreenInk = {70, 220, 90};
inline constexpr Color8 kBlueInk = {90, 150, 255};

// A colour for each of many things, neighbours unlike each other.
[[nodiscard]] Color8 DistinctColor(size_t i);

// A picture to draw on, with smooth edges. Pixel centres at integers.
class Canvas {
 public:
  Canvas(int width, int height, const Color8& paper);

  void Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Color8& ink,
            int thickness_px = 1);
  void Dot(const Eigen::Vector2d& at, int radius_px, const Color8& ink);
  void Box(int x, int y, int width, int height, const Color8& ink);
  // Left end of the base line at `at`; capitals are 12 px high.
  // Smaller where it would be wider than `widest_px`.
  void Text(const Eigen::Vector2d& at, const std::string& text, const Color8& ink,
            double widest_px = std::numeric_limits<double>::infinity());
  // The picture with its top left pixel at (x, y); what does not fit is cut off.
  void Place(const Rgb8& picture, int x, int y);

  [[nodiscard]] Rgb8 Taken() const;

 private:
  int width_;
  int height_;
  std::vector<uint8_t> pixels_;  // interleaved red, green, blue
};

// The panel with a line of text under it.
[[nodiscard]] Rgb8 Captioned(const Rgb8& panel, const std::string& caption);

// "residual, white = 0.012"; `unit` stands after the number.
[[nodiscard]] std::string HeatCaption(const std::string& what, float white,
                                      const std::string& unit);

// `grey` as large as `width` asks, between pixels linearly, with `factor` = new / old size.
[[nodiscard]] Rgb8 ScaledGrey(const Image<uint8_t>& grey, double factor);

}  // namespace sateen
