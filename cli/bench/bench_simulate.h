#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/task.h"
#include "solver/evaluate.h"

namespace sateen::cli {

struct BenchSimulateArgs {
  int width = 4928;        // [px] of the session; a Nikon D5100's
  int height = 3264;       // [px]
  int switch_width = 512;  // [px] of the frames on which each switch is tried
  int threads = 0;
  std::filesystem::path pictures;  // empty: none
  bool json = false;
};

// One step of making a session, over all its frames.
struct SimulateStage {
  std::string name;
  double seconds = 0.0;
  double ns_per_pixel = 0.0;  // per pixel and frame
};

// Cost and effect of one switch in a scene that has nothing else.
struct SimulateSwitch {
  std::string name;
  double ns_per_pixel = 0.0;  // per pixel and frame, with all that every pixel looks at
  double times_plain = 0.0;
  ErrorStatistics angular_error_deg;  // of the solver's defaults on these frames
};

struct SimulateBenchReport {
  ImageSize size;
  int frames = 0;
  int threads = 0;
  std::vector<SimulateStage> stages;
  double seconds = 0.0;
  double peak_memory_gb = 0.0;  // of the process, after the session
  std::vector<SimulateSwitch> switches;
};

void AddBenchSimulate(CLI::App& bench, BenchSimulateArgs& args);
int RunBenchSimulate(const BenchSimulateArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log);

}  // namespace sateen::cli
