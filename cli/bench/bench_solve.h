#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/task.h"
#include "solver/evaluate.h"
#include "solver/lambertian.h"

namespace sateen::cli {

struct BenchSolveArgs {
  int width = 2048;   // [px]
  int height = 1024;  // [px]
  int repeats = 7;
  int threads = 0;
  std::filesystem::path plot;
  bool json = false;
};

// Result of one backend on one case with one number of threads.
struct BenchRow {
  Backend backend = Backend::kAuto;
  std::string case_name;
  int threads = 0;
  double ns_per_pixel = 0.0;
  double times_jacobi_svd = 0.0;  // speed over that of jacobi-svd on as many threads
  double times_floor = 0.0;       // time over that of the memory floor on as many threads
  double solved_fraction = 0.0;
  ErrorStatistics angular_error_deg;
  double albedo_error = 0.0;  // mean, relative
};

struct BenchFloor {
  int threads = 0;
  double ns_per_pixel = 0.0;
  double gb_per_s = 0.0;
};

struct BenchReport {
  ImageSize size;
  int lights = 0;
  std::string instruction_set;
  std::vector<BenchFloor> floors;  // one thread, then all
  std::vector<BenchRow> rows;
};

void AddBenchSolve(CLI::App& bench, BenchSolveArgs& args);
int RunBenchSolve(const BenchSolveArgs& args, const Task& task, std::ostream& out,
                  std::ostream& log);

}  // namespace sateen::cli
