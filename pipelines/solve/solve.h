#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/task.h"
#include "pipelines/solve/evaluation.h"
#include "pipelines/solve/maps_facts.h"
#include "pipelines/solve/relief.h"
#include "pipelines/solve/solve_options.h"
#include "scanner/sessions/dataset.h"
#include "solver/normal_field.h"

namespace sateen {

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
