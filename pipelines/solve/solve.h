#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image_io.h"
#include "pipelines/solve/evaluation.h"
#include "pipelines/solve/maps_facts.h"
#include "pipelines/solve/relief.h"
#include "scanner/sessions/dataset.h"
#include "solver/ladder.h"
#include "solver/lambertian.h"

namespace sateen {

// "auto", "raw", "rgb".
[[nodiscard]] std::string_view Name(Domain domain);
// The mode's name, or "none".
[[nodiscard]] std::string_view Name(const std::optional<LadderMode>& robust);

struct SolveOptions {
  // Session folder, or another layout that ReadDataset() reads.
  std::filesystem::path capture;
  // Folder for the maps; created if missing. Not the capture's own.
  std::filesystem::path output;
  // Lights to use, by index from 0 in the capture; empty: all.
  std::vector<int> lights;
  // Files to use instead of the capture's own; empty: the capture's.
  std::filesystem::path rig_file;
  std::filesystem::path mask_file;
  // Simulated session whose truth the maps are compared with; empty: what lies beside the capture.
  std::filesystem::path truth_dir;
  Encoding encoding = Encoding::kAuto;
  Domain domain = Domain::kAuto;
  // Rungs of the ladder; absent: least squares without weights and without uncertainty.
  std::optional<LadderMode> robust = LadderMode::kAuto;
  LambertianOptions least_squares;
  NormalY normal_y = NormalY::kUp;
  // Height of the surface above the table plane; at most a quarter of the lowest light's.
  double height_mm = 0.0;
  // Whether each pixel's height is found from the normals, and the solve repeated with it.
  bool relief = false;
  // Whether the maps are those of a camera without the lens's distortion.
  bool undistort = false;
  // Largest mean angular error from truth that passes, in (0, 180]; the capture must have truth.
  std::optional<double> fail_above_deg;
};

struct SolveOutcome {
  Dataset dataset;  // its rig is lifted by height_mm
  // Maps in the camera's own pixels. Only the summary where the solve ran band by band into files.
  NormalField field;
  MapsFacts maps;
  std::optional<ReliefOutcome> relief;
  Evaluation evaluation;
  double seconds_reading = 0.0;
  double seconds_total = 0.0;
  // Text of solve.json: one JSON object of schema sateen.solve/1 (docs/formats.md).
  std::string report;
};

// Called with each warning as soon as it is known, in one line. They are in
// SolveOutcome::dataset.warnings, too.
using WarningObserver = std::function<void(const std::string&)>;

/// Solves a capture into a folder of maps: reads it, solves, compares with truth where there is
/// any, writes maps and solve.json (docs/formats.md). On failure the folder stays as it was.
///
/// Errors   kInvalidArgument: an option out of range, or one that excludes another
///          kBadData: the capture is damaged, or lacks what an option needs (lens, truth, near
///          lights)
///          kDegenerate: the lights cannot determine a normal
///          kIo: a file cannot be read or written
///          kCancelled
/// Memory   the frames; maps are held whole only where truth, relief or undistort need them
[[nodiscard]] Result<SolveOutcome> SolveSession(const SolveOptions& options, const Task& task = {},
                                                const WarningObserver& warn = nullptr);

// Returns whether the mean angular error is within options.fail_above_deg; true without a limit.
[[nodiscard]] bool Passed(const SolveOptions& options, const Evaluation& evaluation);

}  // namespace sateen
