#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sateen {

// An axis of a plot, from one value to another over a stretch of pixels.
struct PlotAxis {
  double first = 0.0;
  double last = 1.0;
  double begin_px = 0.0;
  double end_px = 1.0;
  bool is_log = false;

  // Values beyond the ends are put at the ends.
  [[nodiscard]] double At(double value) const;
  // Powers of ten, or steps of 1, 2 or 5, some five to ten of them.
  [[nodiscard]] std::vector<double> Ticks() const;
};

// Pieces of SVG, a line each.
[[nodiscard]] std::string SvgText(double x, double y, std::string_view anchor,
                                  std::string_view text, std::string_view color = "#333333");
[[nodiscard]] std::string SvgLine(double x1, double y1, double x2, double y2,
                                  std::string_view style);
// Grid lines with their values, and what the axes are.
[[nodiscard]] std::string SvgGrid(const PlotAxis& x, const PlotAxis& y, std::string_view x_title,
                                  std::string_view y_title);
// Many dots, as one path; points that are not finite are left out.
[[nodiscard]] std::string SvgDots(const PlotAxis& x, const PlotAxis& y,
                                  const std::vector<std::pair<double, double>>& points,
                                  std::string_view color, double size_px);
[[nodiscard]] std::string SvgCurve(const PlotAxis& x, const PlotAxis& y,
                                   const std::vector<std::pair<double, double>>& points,
                                   std::string_view style);
// A whole file: white, with a font.
[[nodiscard]] std::string SvgFile(int width_px, int height_px, std::string_view content);

}  // namespace sateen
