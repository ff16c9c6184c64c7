#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sateen {

// Axis of a plot, from one value to another over a range of pixels.
struct PlotAxis {
  double first = 0.0;
  double last = 1.0;
  double begin_px = 0.0;
  double end_px = 1.0;
  bool is_log = false;

  // Returns the pixel of a value; values beyond the ends are put at the ends.
  [[nodiscard]] double At(double value) const;
  // Returns powers of ten, or steps of 1, 2 or 5, some five to ten of them.
  [[nodiscard]] std::vector<double> Ticks() const;
};

// Return pieces of SVG, one line each.
[[nodiscard]] std::string SvgText(double x, double y, std::string_view anchor,
                                  std::string_view text, std::string_view color = "#333333");
[[nodiscard]] std::string SvgLine(double x1, double y1, double x2, double y2,
                                  std::string_view style);
// Draws grid lines with their values, and the names of the axes.
[[nodiscard]] std::string SvgGrid(const PlotAxis& x, const PlotAxis& y, std::string_view x_title,
                                  std::string_view y_title);
// Draws many dots as one path; leaves out points that are not finite.
[[nodiscard]] std::string SvgDots(const PlotAxis& x, const PlotAxis& y,
                                  const std::vector<std::pair<double, double>>& points,
                                  std::string_view color, double size_px);
[[nodiscard]] std::string SvgCurve(const PlotAxis& x, const PlotAxis& y,
                                   const std::vector<std::pair<double, double>>& points,
                                   std::string_view style);
// Returns a whole file with a white ground and a font.
[[nodiscard]] std::string SvgFile(int width_px, int height_px, std::string_view content);

}  // namespace sateen
