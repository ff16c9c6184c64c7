#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "cli/bench/bench_accuracy.h"
#include "core/json.h"
#include "core/version.h"
#include "imaging/show/svg_plot.h"

namespace sateen::cli {
namespace {

constexpr int kAccuracyPanelColumns = 3;
constexpr double kAccuracyPanelWidthPx = 380.0;
constexpr double kAccuracyPanelHeightPx = 250.0;
constexpr double kAccuracyTitlePx = 40.0;
constexpr double kAccuracyLabelPx = 12.0;  // from label to label

double SolvedPercent(const AccuracyRow& row) {
  return row.pixels > 0 ? 100.0 * static_cast<double>(row.angular_error_deg.count) /
                              static_cast<double>(row.pixels)
                        : 0.0;
}

// In the order in which they first come.
std::vector<std::string> DataSetsOf(const AccuracyReport& report) {
  std::vector<std::string> names;
  for (const AccuracyRow& row : report.rows) {
    if (std::ranges::find(names, row.data) == names.end()) {
      names.push_back(row.data);
    }
  }
  return names;
}

std::string ColorOfMethod(const std::string& method) {
  return method.starts_with("ladder")          ? "#c03028"
         : method.starts_with("least squares") ? "#3060b0"
                                               : "#777777";
}

// Returns the label of a dot.
struct Label {
  double dot_x = 0.0;
  double dot_y = 0.0;
  double y = 0.0;
  std::string text;
};

// Labels one below the other, none on another, as near to their dots as that allows.
void SpreadLabels(double top, double bottom, std::vector<Label>& labels) {
  std::ranges::sort(labels, {}, &Label::dot_y);
  double next = top;
  for (Label& label : labels) {
    label.y = std::max(label.dot_y, next);
    next = label.y + kAccuracyLabelPx;
  }
  double most = bottom;
  for (auto label = labels.rbegin(); label != labels.rend(); ++label) {
    label->y = std::min(label->y, most);
    most = label->y - kAccuracyLabelPx;
  }
}

// One data set: a dot for each method, ours in colour.
std::string Panel(const AccuracyReport& report, const std::string& data, double left, double top) {
  double worst = 0.0;
  for (const AccuracyRow& row : report.rows) {
    worst = row.data == data ? std::max(worst, row.angular_error_deg.mean) : worst;
  }
  const PlotAxis x{10.0, 1e6, left + 45.0, left + kAccuracyPanelWidthPx - 30.0, true};
  const PlotAxis y{0.0, 1.1 * std::max(worst, 1e-3), top + kAccuracyPanelHeightPx - 40.0,
                   top + 25.0, false};
  std::string svg = SvgText(left + 0.5 * kAccuracyPanelWidthPx, top + 14.0, "middle", data);
  svg += SvgGrid(x, y, "", "");
  std::vector<Label> labels;
  for (const AccuracyRow& row : report.rows) {
    if (row.data == data) {
      svg += SvgDots(x, y, {{row.ns_per_pixel, row.angular_error_deg.mean}},
                     ColorOfMethod(row.method), 7.0);
      labels.push_back({x.At(row.ns_per_pixel), y.At(row.angular_error_deg.mean), 0.0, row.method});
    }
  }
  SpreadLabels(y.end_px + 6.0, y.begin_px - 6.0, labels);
  for (const Label& label : labels) {
    const bool is_right = label.dot_x > x.begin_px + 0.5 * (x.end_px - x.begin_px);
    const double at = is_right ? label.dot_x - 12.0 : label.dot_x + 12.0;
    svg += SvgLine(label.dot_x, label.dot_y, at, label.y,
                   fmt::format("stroke=\"{}\" stroke-width=\"0.7\"", ColorOfMethod(label.text)));
    svg += SvgText(is_right ? at - 2.0 : at + 2.0, label.y + 4.0, is_right ? "end" : "start",
                   label.text, ColorOfMethod(label.text));
  }
  return svg;
}

std::string Ratio(double standardised, double coverage) {
  return coverage > 0.0 ? fmt::format("{:.2f} | {:.1f}", standardised, 100.0 * coverage) : " | ";
}

}  // namespace

std::string JsonReport(const AccuracyReport& report) {
  nlohmann::json rows = nlohmann::json::array();
  for (const AccuracyRow& row : report.rows) {
    nlohmann::json json = {{"data", row.data},
                           {"method", row.method},
                           {"pixels", row.pixels},
                           {"solved", row.angular_error_deg.count},
                           {"mean_deg", row.angular_error_deg.mean},
                           {"median_deg", row.angular_error_deg.median},
                           {"p99_deg", row.angular_error_deg.p99},
                           {"ns_per_pixel_one_thread", row.ns_per_pixel}};
    if (row.megapixels_per_s > 0.0) {
      json["megapixels_per_s"] = row.megapixels_per_s;
    }
    if (row.coverage > 0.0) {
      json["standardised_error"] = row.standardised_error;
      json["coverage"] = row.coverage;
    }
    if (row.albedo_error > 0.0) {
      json["albedo_error"] = row.albedo_error;
    }
    if (row.albedo_coverage > 0.0) {
      json["albedo_standardised_error"] = row.albedo_standardised_error;
      json["albedo_coverage"] = row.albedo_coverage;
    }
    rows.push_back(std::move(json));
  }
  const nlohmann::json json = {{"schema", "sateen.bench.accuracy/1"},
                               {"version", Version()},
                               {"threads", report.threads},
                               {"instruction_set", report.instruction_set},
                               {"rows", std::move(rows)},
                               {"skipped", report.skipped}};
  return JsonText(json);
}

std::string TextReport(const AccuracyReport& report) {
  std::string text = fmt::format(
      "{:<32} {:<22} {:>8} {:>8} {:>8} {:>8} {:>12} {:>6} {:>6} {:>7} {:>8} {:>6} {:>7}\n", "data",
      "method", "mean deg", "median", "p99", "solved %", "ns/px, 1 th.", "Mpx/s", "stand.",
      "in 95 %", "albedo %", "stand.", "in 95 %");
  for (const AccuracyRow& row : report.rows) {
    text += fmt::format("{:<32} {:<22} {:>8.3f} {:>8.3f} {:>8.2f} {:>8.2f} {:>12.0f}", row.data,
                        row.method, row.angular_error_deg.mean, row.angular_error_deg.median,
                        row.angular_error_deg.p99, SolvedPercent(row), row.ns_per_pixel);
    text += row.megapixels_per_s > 0.0 ? fmt::format(" {:>6.1f}", row.megapixels_per_s)
                                       : fmt::format(" {:>6}", "");
    text += row.coverage > 0.0
                ? fmt::format(" {:>6.2f} {:>7.1f}", row.standardised_error, 100.0 * row.coverage)
                : fmt::format(" {:>6} {:>7}", "", "");
    text += row.albedo_error > 0.0 ? fmt::format(" {:>8.3f}", 100.0 * row.albedo_error) : "";
    text += row.albedo_coverage > 0.0
                ? fmt::format(" {:>6.2f} {:>7.1f}", row.albedo_standardised_error,
                              100.0 * row.albedo_coverage)
                : "";
    text += "\n";
  }
  for (const std::string& skipped : report.skipped) {
    text += fmt::format("skipped: {}\n", skipped);
  }
  text += fmt::format(
      "Mpx/s on {} threads ({}); stand.: root mean square of error over predicted uncertainty, of "
      "normals and "
      "of albedo; in 95 %: errors inside the interval that should hold 95 of 100; albedo %: mean "
      "relative "
      "error of its colours, of which two thirds of a mosaic's are interpolated; its stand. and in "
      "95 %: "
      "of luminance, from mosaics of each site's own colour\n",
      report.threads, report.instruction_set);
  return text;
}

std::string MarkdownReport(const AccuracyReport& report, const std::string& plot) {
  std::string text = fmt::format(
      "# Speed against error\n"
      "Written by `sateen bench accuracy --markdown docs/accuracy.md`; `make accuracy` runs it. Do "
      "not edit by hand.\n"
      "\n"
      "Angles between solved and true normals over solved pixels, in degrees; time a pixel of the "
      "mask on one thread,\n"
      "and megapixels a second on {} threads ({}). \"Standardised\" is the root mean square of "
      "error over predicted\n"
      "uncertainty, 1 where the model holds; \"in 95 %\" the share of errors inside the interval "
      "that should hold 95 of\n"
      "100; \"albedo %\" the mean relative error of its colours, and after it the same two of the "
      "albedo's uncertainty, which\n"
      "is that of its luminance, from mosaics of a site's own colour. *LDLT a pixel*, *Huber*, "
      "*L1*, *sparse Bayesian* (Ikehata et al. 2012) and *bdcSvd* "
      "are plain\n"
      "re-implementations from the papers, in double and on one thread; the first four see the "
      "same usable samples as\n"
      "the ladder (docs/solver.md). \"Clipped\": exposed so that the 95th percentile of the masked "
      "green samples is at\n"
      "0.8 of full scale. *mosaics*: solved site by site, without interpolating the colours first. "
      "All with one set of\n"
      "defaults. The bunny's lights are 2, 3, 4, 18, 20, 23, 24, 26, 34, 36, the ball's ten every "
      "tenth.\n",
      report.threads, report.instruction_set);
  if (!plot.empty()) {
    text +=
        fmt::format("\n![Time a pixel against mean error, a panel for each data set]({})\n", plot);
  }
  for (const std::string& data : DataSetsOf(report)) {
    text += fmt::format(
        "\n## {}\n\n| method | mean | median | p99 | solved % | ns/px | Mpx/s | standardised | in "
        "95 % | albedo % | standardised | in 95 % |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
        data);
    for (const AccuracyRow& row : report.rows) {
      if (row.data == data) {
        text += fmt::format(
            "| {} | {:.3f} | {:.3f} | {:.2f} | {:.2f} | {:.0f} | {} | {} | {} | {} |\n", row.method,
            row.angular_error_deg.mean, row.angular_error_deg.median, row.angular_error_deg.p99,
            SolvedPercent(row), row.ns_per_pixel,
            row.megapixels_per_s > 0.0 ? fmt::format("{:.1f}", row.megapixels_per_s) : "",
            Ratio(row.standardised_error, row.coverage),
            row.albedo_error > 0.0 ? fmt::format("{:.3f}", 100.0 * row.albedo_error) : "",
            Ratio(row.albedo_standardised_error, row.albedo_coverage));
      }
    }
  }
  if (!report.skipped.empty()) {
    text += "\n## Skipped\n\n";
    for (const std::string& skipped : report.skipped) {
      text += fmt::format("* {}\n", skipped);
    }
  }
  return text;
}

std::string SvgPlot(const AccuracyReport& report) {
  const std::vector<std::string> names = DataSetsOf(report);
  const auto rows =
      static_cast<int>((names.size() + kAccuracyPanelColumns - 1) / kAccuracyPanelColumns);
  std::string svg = SvgText(0.5 * kAccuracyPanelColumns * kAccuracyPanelWidthPx, 22.0, "middle",
                            "Mean error [degrees] against time [ns/pixel, one thread]: lower left "
                            "is better");
  for (size_t i = 0; i < names.size(); ++i) {
    const size_t row = i / kAccuracyPanelColumns;
    const size_t column = i % kAccuracyPanelColumns;
    svg += Panel(report, names[i], static_cast<double>(column) * kAccuracyPanelWidthPx,
                 kAccuracyTitlePx + static_cast<double>(row) * kAccuracyPanelHeightPx);
  }
  return SvgFile(static_cast<int>(kAccuracyPanelColumns * kAccuracyPanelWidthPx),
                 static_cast<int>(kAccuracyTitlePx + rows * kAccuracyPanelHeightPx), svg);
}

}  // namespace sateen::cli
