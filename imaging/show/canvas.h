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

// Returns a colour for the i-th of many things; neighbours differ clearly.
[[nodiscard]] Color8 DistinctColor(size_t i);

// Picture to draw on, with smooth edges. Pixel centres are at integers.
class Canvas {
 public:
  Canvas(int width, int height, const Color8& paper);

  void Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Color8& ink,
            int thickness_px = 1);
  void Dot(const Eigen::Vector2d& at, int radius_px, const Color8& ink);
  void Box(int x, int y, int width, int height, const Color8& ink);
  // Writes text whose base line starts at `at`; capitals are 12 px high.
  // Writes text in a smaller size where it would be wider than `widest_px`.
  void Text(const Eigen::Vector2d& at, const std::string& text, const Color8& ink,
            double widest_px = std::numeric_limits<double>::infinity());
  // Draws the picture with its top left pixel at (x, y); cuts off what does not fit.
  void Place(const Rgb8& picture, int x, int y);

  [[nodiscard]] Rgb8 Taken() const;

 private:
  int width_;
  int height_;
  std::vector<uint8_t> pixels_;  // interleaved red, green, blue
};

// Returns the panel with a line of text under it.
[[nodiscard]] Rgb8 Captioned(const Rgb8& panel, const std::string& caption);

// Returns "residual, white = 0.012"; `unit` follows the number.
[[nodiscard]] std::string HeatCaption(const std::string& what, float white,
                                      const std::string& unit);

// Returns `grey` scaled to `width`, linearly between pixels; `factor` = new / old size.
[[nodiscard]] Rgb8 ScaledGrey(const Image<uint8_t>& grey, double factor);

}  // namespace sateen
