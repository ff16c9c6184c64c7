#include "imaging/show/svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace sateen {

double PlotAxis::At(double value) const {
  const double here = std::clamp(value, first, last);
  const double share =
      is_log ? std::log(here / first) / std::log(last / first) : (here - first) / (last - first);
  return begin_px + share * (end_px - begin_px);
}

std::vector<double> PlotAxis::Ticks() const {
  constexpr double kRounding = 1e-9;
  std::vector<double> ticks;
  if (is_log) {
    const int from = static_cast<int>(std::ceil(std::log10(first) - kRounding));
    const int to = static_cast<int>(std::floor(std::log10(last) + kRounding));
    for (int power = from; power <= to; ++power) {
      ticks.push_back(std::pow(10.0, power));
    }
    return ticks;
  }
  const double rough = (last - first) / 8.0;
  const double ten = std::pow(10.0, std::floor(std::log10(rough)));
  const double step = ten * (rough / ten > 5.0   ? 10.0
                             : rough / ten > 2.0 ? 5.0
                             : rough / ten > 1.0 ? 2.0
                                                 : 1.0);
  for (double i = std::ceil(first / step - kRounding); i * step <= last + kRounding * step;
       i += 1.0) {
    ticks.push_back(i * step + 0.0);  // + 0.0: no "-0"
  }
  return ticks;
}

std::string SvgText(double x, double y, std::string_view anchor, std::string_view text,
                    std::string_view color) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\">{}</text>\n",
                     x, y, anchor, color, text);
}

std::string SvgLine(double x1, double y1, double x2, double y2, std::string_view style) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x1, y1,
                     x2, y2, style);
}

std::string SvgGrid(const PlotAxis& x, const PlotAxis& y, std::string_view x_title,
                    std::string_view y_title) {
  constexpr std::string_view kGridStyle = "stroke=\"#dddddd\"";
  std::string svg;
  for (const double value : x.Ticks()) {
    svg += SvgLine(x.At(value), y.begin_px, x.At(value), y.end_px, kGridStyle);
    svg += SvgText(x.At(value), y.begin_px + 18.0, "middle", fmt::format("{:g}", value));
  }
  for (const double value : y.Ticks()) {
    svg += SvgLine(x.begin_px, y.At(value), x.end_px, y.At(value), kGridStyle);
    svg += SvgText(x.begin_px - 8.0, y.At(value) + 4.0, "end", fmt::format("{:g}", value));
  }
  svg += SvgText(0.5 * (x.begin_px + x.end_px), y.begin_px + 38.0, "middle", x_title);
  svg += SvgText(x.begin_px, y.end_px - 10.0, "start", y_title);
  return svg;
}

std::string SvgDots(const PlotAxis& x, const PlotAxis& y,
                    const std::vector<std::pair<double, double>>& points, std::string_view color,
                    double size_px) {
  std::string path;
  for (const auto& [px, py] : points) {
    if (std::isfinite(px) && std::isfinite(py)) {
      path += fmt::format("M{:.1f} {:.1f}h.1", x.At(px), y.At(py));
    }
  }
  return fmt::format(
      "<path d=\"{}\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\" fill=\"none\"/>\n",
      path, color, size_px);
}

std::string SvgCurve(const PlotAxis& x, const PlotAxis& y,
                     const std::vector<std::pair<double, double>>& points, std::string_view style) {
  std::string path;
  for (const auto& [px, py] : points) {
    path += fmt::format("{:.1f},{:.1f} ", x.At(px), y.At(py));
  }
  return fmt::format("<polyline points=\"{}\" fill=\"none\" {}/>\n", path, style);
}

std::string SvgFile(int width_px, int height_px, std::string_view content) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} "
      "{1}\" font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" "
      "fill=\"white\"/>\n{2}</svg>\n",
      width_px, height_px, content);
}

}  // namespace sateen
