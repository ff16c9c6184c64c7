#include "solver/ladder.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <utility>
#include <vector>

#include "core/angle.h"
#include "core/parallel.h"
#include "solver/kernels/consensus.h"
#include "solver/least_squares/least_squares.h"
#include "solver/lobe/lobe_search.h"
#include "solver/robust/climb.h"
#include "solver/robust/noise_scale.h"

namespace sateen {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kQuarterSquareDegree = static_cast<float>(0.25 * kDegPerRad * kDegPerRad);

constexpr std::array<std::pair<LadderMode, std::string_view>, 3> kModeNames = {{
    {LadderMode::kAuto, "auto"},
    {LadderMode::kLeastSquares, "least-squares"},
    {LadderMode::kConsensus, "robust"},
}};

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Adds the model's error to the uncertainty of rung 1.
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

// |f(-1) - 2 f + f(+1)|^2 of neighbours `step` apart; one that is unsolved or beyond the border is as far
// from f as the other.
template <typename At>
float SquaredBendAt(const NormalField& field, const At& f, size_t p, size_t step, bool has_before,
                    bool has_after) {
  const bool before = has_before && IsSolved(field, p - step);
  const bool after = has_after && IsSolved(field, p + step);
  if (before && after) {
    return (f(p - step) - 2.0F * f(p) + f(p + step)).squaredNorm();
  }
  return before  ? 4.0F * (f(p - step) - f(p)).squaredNorm()
         : after ? 4.0F * (f(p + step) - f(p)).squaredNorm()
                 : 0.0F;
}

// (16), and the sums of the uncertainties anew.
Status DoubtInterpolation(const Task& task, NormalField& field, PieceSummary& total) {
  const ImageSize size = field.reason.Size();
  const auto width = static_cast<size_t>(size.width);
  std::vector<PieceSummary> rows(static_cast<size_t>(size.height));
  const Task silent{.threads = task.threads, .cancel = task.cancel};
  const auto normal_at = [&](size_t p) {
    return Eigen::Vector3f(field.normal[0].pixels[p], field.normal[1].pixels[p],
                           field.normal[2].pixels[p]);
  };
  const auto albedo_at = [&](size_t p) { return Eigen::Matrix<float, 1, 1>(AlbedoAt(field, p)); };
  Status status = ParallelFor(size.height, RowsPerPiece(size), silent, [&](int begin, int end) {
    for (int row = begin; row < end; ++row) {
      PieceSummary& sums = rows[static_cast<size_t>(row)];
      for (size_t x = 0; x < width; ++x) {
        const size_t p = field.model.Index(0, row) + x;
        if (!IsSolved(field, p)) {
          continue;
        }
        const auto bend_of = [&](const auto& f) {
          return SquaredBendAt(field, f, p, 1, x > 0, x + 1 < width) +
                 SquaredBendAt(field, f, p, width, row > 0, row + 1 < size.height);
        };
        float& uncertainty = field.uncertainty.pixels[p];
        uncertainty = std::min(180.0F, std::sqrt(uncertainty * uncertainty +
                                                 kQuarterSquareDegree * bend_of(normal_at)));
        const float albedo = albedo_at(p).x();
        float& of_albedo = field.albedo_uncertainty.pixels[p];
        of_albedo = albedo > 0.0F
                        ? std::min(1.0F, std::sqrt(of_albedo * of_albedo +
                                                   0.25F * bend_of(albedo_at) / (albedo * albedo)))
                        : 1.0F;
        const auto rung = static_cast<Rung>(field.model.pixels[p]);
        double& sum = rung <= Rung::kUnchecked ? sums.least_squares_deg
                      : rung == Rung::kLobe    ? sums.lobe_deg
                                               : sums.robust_deg;
        sum += static_cast<double>(uncertainty);
      }
    }
  });
  total.least_squares_deg = total.robust_deg = total.lobe_deg = 0.0;
  for (const PieceSummary& row : rows) {
    total.least_squares_deg += row.least_squares_deg;
    total.robust_deg += row.robust_deg;
    total.lobe_deg += row.lobe_deg;
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

// All rungs, piece by piece.
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

Status LadderOptions::Validate() const {
  if (!(false_alarms > 0.0 && false_alarms < 0.5)) {
    return Fail(ErrorCode::kInvalidArgument, "false_alarms = {:g}; need 0 < false_alarms < 0.5",
                false_alarms);
  }
  if (!(explained_residual >= 0.0 && explained_residual < 1.0)) {
    return Fail(ErrorCode::kInvalidArgument,
                "explained_residual = {:g}; need 0 <= explained_residual < 1", explained_residual);
  }
  return least_squares.Validate();
}

Status SolveLadderInto(const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                       const LadderOptions& options, const Task& task, NormalField& field) {
  const Clock::time_point start = Clock::now();
  if (Status status = CheckOptions(stack, options); !status) {
    return status;
  }
  const StackNoise noise = options.noise ? *options.noise : UnknownNoise(stack.size());
  const Result<LeastSquaresRows> rows =
      LeastSquaresRows::Make(stack, rig, mask, options.least_squares, &noise);
  if (!rows) {
    return tl::unexpected(rows.error());
  }
  const ImageSize size = stack[0].rgb.Size();
  field.Resize(size);
  if (field.model.Size() != size || field.albedo_uncertainty.Size() != size) {
    field.uncertainty = Image<float>(size);
    field.albedo_uncertainty = Image<float>(size);
    field.model = Image<uint8_t>(size);
  }
  field.summary = {};
  const bool known = options.noise.has_value();
  const NoiseScale scale = FindNoiseScale(stack, mask, *rows, known);
  Climb climb = MakeClimb(stack, rig, options, *rows, noise, scale.scale_squared);
  if (options.mode == LadderMode::kAuto) {
    climb.lobe = FindLobe(stack, rig, options.least_squares, noise, scale.scale_squared,
                          scale.sample, climb.limit, task.ThreadCount());
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
  summary.seconds = SecondsSince(start);
  ReportRungs(total, summary);
  return {};
}

Result<NormalField> SolveLadder(const LightStack& stack, const Rig& rig,
                                const std::optional<Mask>& mask, const LadderOptions& options,
                                const Task& task) {
  NormalField field;
  if (Status status = SolveLadderInto(stack, rig, mask, options, task, field); !status) {
    return tl::unexpected(status.error());
  }
  return field;
}

}  // namespace sateen
