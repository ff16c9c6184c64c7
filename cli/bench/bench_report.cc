#include "cli/bench/bench_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/json.h"
#include "imaging/show/svg_plot.h"

namespace sateen::cli {
namespace {

struct Style {
  std::string_view name;
  std::string_view color;
};

constexpr std::array<Style, 6> kCases = {{{"clean", "#1b7837"},
                                          {"noisy", "#2166ac"},
                                          {"hard", "#b2182b"},
                                          {"led", "#bf812d"},
                                          {"led+field", "#01665e"},
                                          {"subnormal", "#762a83"}}};

std::string ColorOf(std::string_view case_name) {
  const auto* found = std::find_if(kCases.begin(), kCases.end(),
                                   [&](const Style& style) { return style.name == case_name; });
  return std::string(found == kCases.end() ? "#000000" : found->color);
}

std::string Marks(const BenchReport& report, const PlotAxis& x, const PlotAxis& y) {
  std::string svg;
  for (const BenchRow& row : report.rows) {
    if (row.threads != report.floors.back().threads || row.angular_error_deg.count == 0) {
      continue;
    }
    const double px = x.At(row.ns_per_pixel);
    const double py = y.At(row.angular_error_deg.mean);
    const std::string color = ColorOf(row.case_name);
    svg +=
        fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"5\" fill=\"{}\"/>\n", px, py, color);
    // Slanted, as backends lie close together: auto below its mark, the others above.
    const bool below = row.backend == Backend::kAuto;
    svg += fmt::format(
        "<text transform=\"translate({:.1f} {:.1f}) rotate({})\" fill=\"{}\">{}</text>\n", px + 5.0,
        below ? py + 12.0 : py - 6.0, below ? 40 : -40, color, Name(row.backend));
  }
  return svg;
}

}  // namespace

std::string JsonReport(const BenchReport& report) {
  nlohmann::json json = {{"schema", "sateen.bench.solve/1"},
                         {"size_px", {report.size.width, report.size.height}},
                         {"lights", report.lights},
                         {"instruction_set", report.instruction_set},
                         {"floor_gb_per_s", report.floors.back().gb_per_s},
                         {"floors", nlohmann::json::array()},
                         {"rows", nlohmann::json::array()}};
  for (const BenchFloor& floor : report.floors) {
    json["floors"].push_back({{"threads", floor.threads},
                              {"ns_per_pixel", floor.ns_per_pixel},
                              {"gb_per_s", floor.gb_per_s}});
  }
  for (const BenchRow& row : report.rows) {
    json["rows"].push_back({{"backend", Name(row.backend)},
                            {"case", row.case_name},
                            {"threads", row.threads},
                            {"ns_per_pixel", row.ns_per_pixel},
                            {"times_jacobi_svd", row.times_jacobi_svd},
                            {"times_floor", row.times_floor},
                            {"solved_fraction", row.solved_fraction},
                            {"angular_error_deg",
                             {{"mean", row.angular_error_deg.mean},
                              {"p99", row.angular_error_deg.p99},
                              {"max", row.angular_error_deg.max}}},
                            {"albedo_error", row.albedo_error}});
  }
  return JsonText(json);
}

std::string TextReport(const BenchReport& report) {
  std::string text = fmt::format("{} near lights, {}x{} px, RGB and luminance, {}\n", report.lights,
                                 report.size.width, report.size.height, report.instruction_set);
  for (const BenchFloor& floor : report.floors) {
    text += fmt::format("floor, {} thread{}: {:.2f} ns/px ({:.1f} GB/s, the same bytes moved)\n",
                        floor.threads, floor.threads == 1 ? " " : "s", floor.ns_per_pixel,
                        floor.gb_per_s);
  }
  text += fmt::format("{:<9} {:<10} {:>7} {:>9} {:>10} {:>7} {:>8} {:>10} {:>10} {:>10} {:>10}\n",
                      "case", "backend", "threads", "ns/px", "x jacobi", "x floor", "solved %",
                      "mean deg", "p99 deg", "max deg", "albedo %");
  for (const BenchRow& row : report.rows) {
    text += fmt::format(
        "{:<9} {:<10} {:>7} {:>9.2f} {:>10.1f} {:>7.1f} {:>8.2f} {:>10.3g} {:>10.3g} {:>10.3g} "
        "{:>10.3g}\n",
        row.case_name, Name(row.backend), row.threads, row.ns_per_pixel, row.times_jacobi_svd,
        row.times_floor, 100.0 * row.solved_fraction, row.angular_error_deg.mean,
        row.angular_error_deg.p99, row.angular_error_deg.max, 100.0 * row.albedo_error);
  }
  text +=
      "x jacobi: times as fast as jacobi-svd on as many threads; x floor: times as slow as the "
      "floor";
  return text;
}

std::string SvgPlot(const BenchReport& report) {
  const PlotAxis x{1.0, 1e4, 70.0, 660.0, true};
  const PlotAxis y{1e-7, 10.0, 400.0, 40.0, true};
  const BenchFloor& floor = report.floors.back();
  std::string svg =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"780\" height=\"460\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n"
      "<rect width=\"780\" height=\"460\" fill=\"#ffffff\"/>\n";
  svg += SvgText(365.0, 22.0, "middle",
                 fmt::format("{} near lights, {} threads, {}: lower left is better", report.lights,
                             floor.threads, report.instruction_set));
  svg += SvgGrid(x, y, "", "");
  svg += SvgLine(x.At(floor.ns_per_pixel), y.begin_px, x.At(floor.ns_per_pixel), y.end_px,
                 "stroke=\"#888888\" stroke-dasharray=\"4 3\"");
  svg += SvgText(x.At(floor.ns_per_pixel) + 4.0, y.end_px + 12.0, "start", "memory bandwidth");
  svg += Marks(report, x, y);
  for (size_t i = 0; i < kCases.size(); ++i) {
    const double at = 60.0 + 20.0 * static_cast<double>(i);
    svg += fmt::format("<circle cx=\"690\" cy=\"{:.1f}\" r=\"5\" fill=\"{}\"/>\n", at - 4.0,
                       kCases[i].color);
    svg += SvgText(702.0, at, "start", kCases[i].name, kCases[i].color);
  }
  svg += SvgText(365.0, 440.0, "middle", "time [ns/pixel]");
  svg +=
      "<text transform=\"translate(18 220) rotate(-90)\" text-anchor=\"middle\" "
      "fill=\"#333333\">mean angular error [degrees]</text>\n</svg>\n";
  return svg;
}

}  // namespace sateen::cli
