#pragma once

#include <filesystem>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/task.h"
#include "imaging/image.h"
#include "pipelines/calibrate/predicted_errors.h"

namespace sateen::cli {

struct BenchCalibrateArgs {
  int width = 4928;   // [px] of the frames; a Nikon D5100's
  int height = 3264;  // [px]
  int rigs = 100;     // for the predicted standard deviations
  int threads = 0;
  bool json = false;
};

// Errors of `sateen calibrate lights` on one set of sheets, the worst of the lights.
struct CalibrateRow {
  std::string sheets;
  double position_mm = 0.0;
  double direction_deg = 0.0;
  double flux = 0.0;      // relative
  double flat_deg = 0.0;  // how flat the first sheet then solves, edge to edge
  double seconds = 0.0;   // reading, fitting, pictures
  double peak_memory_gb = 0.0;
};

// Errors of a fabric solved with the lights of one calibration.
struct FabricRow {
  std::string lights;
  double low_frequency_deg = 0.0;  // the worst below 1 cycle per 50 mm
  double mean_deg = 0.0;           // of all pixels
};

struct CalibrateBenchReport {
  ImageSize size;
  int lights = 0;
  int threads = 0;
  std::vector<CalibrateRow> rows;
  int raw_frames = 0;        // of all sheets
  double raw_seconds = 0.0;  // to decode them and nothing else
  std::vector<FabricRow> fabric;
  std::map<int, ErrorRatios> ratios;  // by the number of tilts
};

void AddBenchCalibrate(CLI::App& bench, BenchCalibrateArgs& args);
int RunBenchCalibrate(const BenchCalibrateArgs& args, const Task& task, std::ostream& out,
                      std::ostream& log);

// Schema sateen.bench.calibrate/1 (docs/formats.md).
[[nodiscard]] std::string JsonReport(const CalibrateBenchReport& report);
[[nodiscard]] std::string TextReport(const CalibrateBenchReport& report);

}  // namespace sateen::cli
