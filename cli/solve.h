#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/task.h"
#include "scanner/sessions/dataset.h"
#include "solver/evaluate.h"
#include "solver/lambertian.h"

namespace sateen::cli {

struct SolveArgs {
  std::filesystem::path capture;
  std::filesystem::path output;
  ReadDatasetOptions read;
  std::string rig_file;   // empty: the capture's own
  std::string mask_file;  // empty: the capture's own
  std::string truth_dir;  // empty: what lies beside the capture
  std::string encoding = "auto";
  std::string backend = "auto";
  std::string robust = "auto";
  std::string domain = "auto";
  std::string normal_y = "up";
  LambertianOptions solver;
  int threads = 0;
  // Largest mean angular error from truth that passes, in (0, 180]; the capture must have truth.
  std::optional<double> fail_above_deg;
  double height_mm = 0.0;  // of the surface above the table's plane
  bool relief = false;     // solve again with each pixel at its own height
  bool undistort = false;  // maps as the ideal pinhole camera would have them
  bool json = false;
};

// What --relief found.
struct ReliefOutcome {
  Image<float> height_mm;  // above the table's plane
  double lowest_mm = 0.0;  // of the solved pixels
  double highest_mm = 0.0;
  ErrorStatistics turned_deg;  // normals of the second solve against the first's
  double seconds = 0.0;        // that the heights took, without either solve
};

// Everything that a report speaks of.
struct SolveOutcome {
  Dataset capture;
  // Of captures that are solved band by band straight into maps the summary alone.
  NormalField field;
  std::optional<ReliefOutcome> relief;
  std::optional<ErrorStatistics> angular_error_deg;
  std::optional<ErrorStatistics> low_frequency_error_deg;  // where the rig has a camera, too
  std::optional<ErrorStatistics> albedo_error;
  double seconds_reading = 0.0;
  double seconds_total = 0.0;
};

// Whether the mean angular error is within args.fail_above_deg; true where that is not given.
[[nodiscard]] bool Passed(const SolveArgs& args, const SolveOutcome& outcome);

void AddSolve(CLI::App& root, SolveArgs& args);
// Returns the program's exit status. Results go to `out`, warnings and errors to `log`.
int RunSolve(const SolveArgs& args, const Task& task, std::ostream& out, std::ostream& log);

}  // namespace sateen::cli
