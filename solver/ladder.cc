#include "solver/ladder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "core/option_range.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "solver/least_squares/least_squares.h"
#include "solver/lobe/lobe_search.h"
#include "solver/robust/climb.h"
#include "solver/robust/interpolation.h"
#include "solver/robust/noise_scale.h"

namespace sateen {
namespace {

constexpr std::array<std::pair<LadderMode, std::string_view>, 3> kModeNames = {{
    {LadderMode::kAuto, "auto"},
    {LadderMode::kLeastSquares, "least-squares"},
    {LadderMode::kConsensus, "robust"},
}};

// Adds the error of the model to the uncertainties of rung 1.
Status DoubtLeastSquares(const Doubt& doubt, const Task& task, NormalField& field,
                         PieceSummary& total) {
  const ImageSize size = field.reason.Size();
  std::vector<double> sums(static_cast<size_t>(size.height), 0.0);
  Status status = ParallelFor(
      size.height, RowsPerPiece(size), {.threads = task.threads, .cancel = task.cancel},
      [&](int begin, int end) {
        for (size_t p = field.model.Index(0, begin); p < field.model.Index(0, end); ++p) {
          const auto rung = static_cast<Rung>(field.model.pixels[p]);
          if (rung == Rung::kLeastSquares || rung == Rung::kUnchecked) {
            doubt.AddTo(field, p);
            sums[static_cast<size_t>(begin)] += static_cast<double>(field.uncertainty.pixels[p]);
          }
        }
      });
  total.least_squares_deg = 0.0;
  for (const double sum : sums) {
    total.least_squares_deg += sum;
  }
  return status;
}

Status CheckNoise(const std::optional<StackNoise>& noise, const LightStack& stack) {
  for (size_t k = 0; noise && k < stack.size(); ++k) {
    for (size_t c = 0; c < 3; ++c) {
      const double shot = (*noise)[k].shot[c];
      const double read = (*noise)[k].read[c];
      if (!(std::isfinite(shot) && std::isfinite(read) && shot >= 0.0 && read >= 0.0 &&
            shot + read > 0.0)) {
        return Fail(ErrorCode::kInvalidArgument,
                    "noise of {}, channel {}: shot = {:g}, read = {:g}; need both finite and >= 0, "
                    "and one of them > 0",
                    stack[k].name, c, shot, read);
      }
    }
  }
  return {};
}

Status CheckOptions(const LightStack& stack, const LadderOptions& options) {
  if (Status status = options.Validate(); !status) {
    return status;
  }
  if (options.noise && options.noise->size() != stack.size()) {
    return Fail(ErrorCode::kBadData, "noise of {} frames, but {} frames", options.noise->size(),
                stack.size());
  }
  return CheckNoise(options.noise, stack);
}

// Climbs all rungs, piece by piece.
Status ClimbAllRows(const Climb& climb, const Task& task, NormalField& field, PieceSummary& total) {
  const ImageSize size = field.reason.Size();
  std::vector<PieceSummary> pieces(static_cast<size_t>(size.height));
  task.BeginStage("solving", size.height);
  Status status = ParallelFor(size.height, RowsPerClimb(size), task, [&](int begin, int end) {
    pieces[static_cast<size_t>(begin)] = SolveAndClimb(climb, begin, end, field);
  });
  for (const PieceSummary& piece : pieces) {
    total.Add(piece);
  }
  if (const Doubt doubt = DoubtOf(total); status && !doubt.IsNone()) {
    status = DoubtLeastSquares(doubt, task, field, total);
  }
  return status;
}

}  // namespace

std::string_view Name(LadderMode mode) { return kModeNames[static_cast<size_t>(mode)].second; }

std::optional<LadderMode> LadderModeNamed(std::string_view name) {
  for (const auto& [value, mode_name] : kModeNames) {
    if (mode_name == name) {
      return value;
    }
  }
  return std::nullopt;
}

Status ClimbOptions::Validate() const {
  if (!(false_alarms > 0.0 && false_alarms < 0.5)) {
    return OutOfRange("false_alarms", false_alarms, "0 < false_alarms < 0.5");
  }
  if (!(explained_residual >= 0.0 && explained_residual < 1.0)) {
    return OutOfRange("explained_residual", explained_residual, "0 <= explained_residual < 1");
  }
  return {};
}

Status LadderOptions::Validate() const {
  return climb.Validate().and_then([&] { return least_squares.Validate(); });
}

Status SolveLadderInto(const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                       const LadderOptions& options, const Task& task, NormalField& field,
                       const std::optional<Image<float>>& height_mm) {
  const Stopwatch stopwatch;
  if (Status status = CheckOptions(stack, options); !status) {
    return status;
  }
  const StackNoise noise = options.noise ? *options.noise : UnknownNoise(stack.size());
  const FramesInput input(stack, rig, mask, height_mm);
  const Result<LeastSquaresRows> rows =
      LeastSquaresRows::Make(input, options.least_squares, &noise);
  if (!rows) {
    return tl::unexpected(rows.error());
  }
  field.Resize(stack[0].rgb.Size(), /*with_ladder=*/true);
  field.summary = {};
  const bool known = options.noise.has_value();
  const NoiseScale scale = FindNoiseScale(input, *rows, known);
  Climb climb = MakeClimb(input, options, *rows, noise, scale.scale_squared);
  if (options.mode == LadderMode::kAuto) {
    climb.lobe = FindLobe(input, options.least_squares, noise, scale.scale_squared, scale.sample,
                          climb.limit, task.ThreadCount());
  }
  PieceSummary total;
  if (Status status = ClimbAllRows(climb, task, field, total); !status) {
    return status;
  }
  if (std::ranges::all_of(stack, &LightFrame::raw)) {
    if (Status status = DoubtInterpolation(task, field, total); !status) {
      return status;
    }
  }
  SolveSummary& summary = field.summary;
  AddCounts(total.counts, summary);
  FinishSummary(options.least_squares, task, summary);
  summary.noise_scale = std::isfinite(climb.scale_squared) ? std::sqrt(climb.scale_squared) : 0.0;
  summary.noise_known = known;
  summary.lobe = climb.lobe;
  summary.seconds = stopwatch.Seconds();
  ReportRungs(total, summary);
  return {};
}

Result<NormalField> SolveLadder(const LightStack& stack, const Rig& rig,
                                const std::optional<Mask>& mask, const LadderOptions& options,
                                const Task& task, const std::optional<Image<float>>& height_mm) {
  NormalField field;
  if (Status status = SolveLadderInto(stack, rig, mask, options, task, field, height_mm); !status) {
    return tl::unexpected(status.error());
  }
  return field;
}

}  // namespace sateen
