#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/task.h"
#include "solver/evaluate.h"

namespace sateen::cli {

struct BenchAccuracyArgs {
  std::filesystem::path data;                 // empty: $SATEEN_DATA, or none
  std::vector<std::filesystem::path> scenes;  // scene files, rendered as camera RAW
  int repeats = 5;
  int threads = 0;
  std::filesystem::path plot;      // SVG; empty: none
  std::filesystem::path markdown;  // empty: none
  bool json = false;
};

// Result of a method on a data set.
struct AccuracyRow {
  std::string data;
  std::string method;
  ErrorStatistics angular_error_deg;  // over solved pixels
  int64_t pixels = 0;                 // inside the mask
  double ns_per_pixel = 0.0;          // on one thread
  double megapixels_per_s = 0.0;      // on all threads; 0: the method has one
  // Root mean square of error over uncertainty, and share of errors inside the 95 % interval; 0 for
  // methods without uncertainty.
  double standardised_error = 0.0;
  double coverage = 0.0;
  // Mean relative error of the albedo's colours, and the same two figures of its uncertainty; 0
  // where no truth is known.
  double albedo_error = 0.0;
  double albedo_standardised_error = 0.0;
  double albedo_coverage = 0.0;
};

struct AccuracyReport {
  int threads = 0;
  std::string instruction_set;
  std::vector<AccuracyRow> rows;
  std::vector<std::string> skipped;  // data sets, and why
};

void AddBenchAccuracy(CLI::App& bench, BenchAccuracyArgs& args);
int RunBenchAccuracy(const BenchAccuracyArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log);

// Schema sateen.bench.accuracy/1 (docs/formats.md).
[[nodiscard]] std::string JsonReport(const AccuracyReport& report);
[[nodiscard]] std::string TextReport(const AccuracyReport& report);
// Returns the page docs/accuracy.md; `plot` is the path of its picture relative to it, or empty.
[[nodiscard]] std::string MarkdownReport(const AccuracyReport& report, const std::string& plot);
// Plots time per pixel against mean error, a panel per data set; lower left is better.
[[nodiscard]] std::string SvgPlot(const AccuracyReport& report);

}  // namespace sateen::cli
