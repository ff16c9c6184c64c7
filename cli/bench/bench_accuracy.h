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

// A method on a data set.
struct AccuracyRow {
  std::string data;
  std::string method;
  ErrorStatistics angular_error_deg;  // of solved pixels
  int64_t pixels = 0;                 // inside the mask
  double ns_per_pixel = 0.0;          // on one thread
  double megapixels_per_s = 0.0;      // on all threads; 0: the method has one
  // Of a ladder: root mean square of error over uncertainty, and share of errors inside the interval
  // that should hold 95 of 100; 0 without one.
  double standardised_error = 0.0;
  double coverage = 0.0;
  // Mean relative error of the colours of albedo, and of a ladder the same two of its uncertainty; 0 where
  // no truth is known.
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
// The page docs/accuracy.md; `plot` is its picture's place, relative to it, or empty.
[[nodiscard]] std::string MarkdownReport(const AccuracyReport& report, const std::string& plot);
// A panel for each data set: time a pixel against mean error; lower left is better.
[[nodiscard]] std::string SvgPlot(const AccuracyReport& report);

}  // namespace sateen::cli
