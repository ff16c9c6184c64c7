#include "pipelines/solve/solve.h"

#include <utility>

#include "core/files/output_folder.h"
#include "core/stopwatch.h"
#include "pipelines/solve/mosaic_maps.h"
#include "pipelines/solve/solve_checks.h"
#include "pipelines/solve/solve_frames.h"
#include "pipelines/solve/solve_report.h"
#include "pipelines/solve/stage_maps.h"

namespace sateen {
namespace {

std::optional<std::filesystem::path> IfGiven(const std::filesystem::path& path) {
  return path.empty() ? std::nullopt : std::optional(path);
}

std::optional<int64_t> PixelsOf(const std::optional<int>& megapixels) {
  return megapixels ? std::optional(int64_t{1'000'000} * *megapixels) : std::nullopt;
}

Domain DomainToRead(const SolveOptions& options) {
  const bool is_auto = options.domain == Domain::kAuto;
  return is_auto && !SolvesMosaics(options.least_squares.backend) ? Domain::kRgb : options.domain;
}

// Reads the capture with its rig lifted to the surface.
Result<Dataset> ReadForSolve(const SolveOptions& options, const Task& task) {
  Result<Dataset> dataset = ReadDataset(options.capture,
                                        {.lights = options.lights,
                                         .rig_file = IfGiven(options.rig_file),
                                         .mask_file = IfGiven(options.mask_file),
                                         .truth_dir = IfGiven(options.truth_dir),
                                         .encoding = options.encoding,
                                         .domain = DomainToRead(options),
                                         .by_noise = options.robust.has_value(),
                                         .scratch_dir = options.output,
                                         .max_pixels = PixelsOf(options.max_megapixels)},
                                        task);
  if (!dataset) {
    return dataset;
  }
  if (Status status = CheckSupported(options, *dataset); !status) {
    return tl::unexpected(status.error());
  }
  if (options.height_mm != 0.0) {
    Result<Rig> lifted = Lifted(std::move(dataset->rig), options.height_mm);
    if (!lifted) {
      return tl::unexpected(lifted.error());
    }
    dataset->rig = *std::move(lifted);
  }
  return dataset;
}

// Returns whether no map needs another row of itself than the one that is written.
bool CanStream(const SolveOptions& options, const Dataset& dataset) {
  return dataset.mosaics && !dataset.truth && !options.undistort && !options.relief;
}

Status SolveByBands(const SolveOptions& options, const Task& task, OutputFolder& folder,
                    SolveOutcome& outcome) {
  const Dataset& dataset = outcome.dataset;
  return SolveIntoMaps(dataset.mosaics->stack, dataset.rig, dataset.mask,
                       {.mode = options.robust, .least_squares = options.least_squares},
                       outcome.maps, task, folder)
      .map([&](const SolveSummary& summary) { outcome.field.summary = summary; });
}

Status SolveWhole(const SolveOptions& options, const Task& task, OutputFolder& folder,
                  SolveOutcome& outcome) {
  const Dataset& dataset = outcome.dataset;
  Result<NormalField> field = SolveFrames(options, dataset, /*height_mm=*/std::nullopt, task);
  if (!field) {
    return tl::unexpected(field.error());
  }
  outcome.field = *std::move(field);
  if (options.relief) {
    Result<ReliefOutcome> relief = SolveAtHeights(options, dataset, task, outcome.field);
    if (!relief) {
      return tl::unexpected(relief.error());
    }
    outcome.relief = *std::move(relief);
  }
  if (dataset.truth) {
    Result<Evaluation> evaluation = Evaluate(outcome.field, *dataset.truth, dataset.rig.camera);
    if (!evaluation) {
      return tl::unexpected(evaluation.error());
    }
    outcome.evaluation = *std::move(evaluation);
  }
  return StageWhole(options, outcome, task, folder);
}

}  // namespace

bool Passed(const SolveOptions& options, const Evaluation& evaluation) {
  // Not "above", so that NaN does not pass.
  return !options.fail_above_deg || (evaluation.angular_error_deg.has_value() &&
                                     evaluation.angular_error_deg->mean <= *options.fail_above_deg);
}

Result<SolveOutcome> SolveSession(const SolveOptions& options, const Task& task,
                                  const WarningObserver& warn) {
  const Stopwatch stopwatch;
  if (Status status = options.least_squares.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  // Opened before the work, so that a folder that cannot be written to is reported at once.
  Result<OutputFolder> folder = OutputFolder::Open(options.output);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  Result<Dataset> dataset = ReadForSolve(options, task);
  if (!dataset) {
    return tl::unexpected(dataset.error());
  }
  for (const std::string& warning : dataset->warnings) {
    if (warn) {
      warn(warning);
    }
  }
  SolveOutcome outcome{.maps = MapsFactsOf(options, dataset->rig)};
  outcome.dataset = *std::move(dataset);
  outcome.seconds_reading = stopwatch.Seconds();
  const Status done =
      (CanStream(options, outcome.dataset) ? SolveByBands(options, task, *folder, outcome)
                                           : SolveWhole(options, task, *folder, outcome))
          .and_then([&] { return StageHeight(options, outcome, task, *folder); })
          .and_then([&] { return task.CheckCancelled(); })
          .and_then([&] {
            outcome.seconds_total = stopwatch.Seconds();
            outcome.report = SolveReportJson(options, outcome);
            return folder->WriteText("solve.json", outcome.report + "\n");
          })
          .and_then([&] { return folder->Commit(); });
  if (!done) {
    return tl::unexpected(folder->InPlace(done.error()));
  }
  return outcome;
}

}  // namespace sateen
