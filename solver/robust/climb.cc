#include "solver/robust/climb.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/angle.h"
#include "solver/noise.h"
#include "solver/robust/consensus.h"

namespace sateen {
namespace {

constexpr int kPiecesPerClimb = 8;
constexpr int kFewestClimbs = 32;  // enough work for all threads
constexpr size_t kSumBlock = 512;
constexpr size_t kBlock = 64;  // pixels that are compared together

bool NeedsConsensus(const Climb& climb, const NormalField& field, float misfit, size_t pixel) {
  if (field.samples.pixels[pixel] <= 3) {
    return false;  // three samples always agree
  }
  if (field.model.pixels[pixel] == static_cast<uint8_t>(Rung::kLobe)) {
    return false;
  }
  if (climb.options.mode != LadderMode::kAuto) {
    return climb.options.mode == LadderMode::kConsensus;
  }
  if (misfit <= climb.limit[field.samples.pixels[pixel]]) {
    return false;
  }
  return field.residual.pixels[pixel] >
         static_cast<float>(climb.options.climb.explained_residual) * AlbedoAt(field, pixel);
}

// Does the work of FastRows::SolveConsensus in double.
void SolveConsensusInDouble(const Climb& climb, std::span<const size_t> pixels, NormalField& field,
                            std::span<uint8_t> agreeing) {
  PixelSystem system(climb.input, climb.options.least_squares);
  const auto width = static_cast<size_t>(field.reason.width);
  for (size_t j = 0; j < pixels.size(); ++j) {
    const size_t pixel = pixels[j];
    system.Gather(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
    const ConsensusAnswer answer =
        PlainConsensus(system, climb.options.least_squares.max_condition);
    const Eigen::Vector3d n = answer.n.stableNormalized();
    if (!n.allFinite() || n.isZero()) {
      agreeing[j] = 0;
      continue;
    }
    for (size_t c = 0; c < 3; ++c) {
      const auto column = static_cast<Eigen::Index>(c);
      field.normal[c].pixels[pixel] = static_cast<float>(n[column]);
      field.albedo[c].pixels[pixel] = static_cast<float>(answer.albedo[column]);
    }
    field.residual.pixels[pixel] = static_cast<float>(answer.residual);
    field.uncertainty.pixels[pixel] = static_cast<float>(std::min(answer.uncertainty_deg, 180.0));
    field.albedo_uncertainty.pixels[pixel] =
        static_cast<float>(std::min(answer.albedo_uncertainty, 1.0));
    agreeing[j] = static_cast<uint8_t>(std::min(answer.agreeing, 255));
  }
}

// Solves the pixels that float refused in double.
void SolveRefusedInDouble(const Climb& climb, std::span<const size_t> pixels, NormalField& field,
                          std::span<uint8_t> agreeing) {
  std::vector<size_t> places;
  std::vector<size_t> refused;
  for (size_t j = 0; j < pixels.size(); ++j) {
    if (agreeing[j] == 0) {
      places.push_back(j);
      refused.push_back(pixels[j]);
    }
  }
  if (refused.empty()) {
    return;
  }
  std::vector<uint8_t> of_refused(refused.size());
  SolveConsensusInDouble(climb, refused, field, of_refused);
  for (size_t j = 0; j < places.size(); ++j) {
    agreeing[places[j]] = of_refused[j];
  }
}

// Adds some hundred uncertainties in eight lanes, which the compiler turns into a vector.
double SumOf(std::span<const float> values) {
  std::array<float, 8> sums = {};
  size_t j = 0;
  for (; j + sums.size() <= values.size(); j += sums.size()) {
    for (size_t lane = 0; lane < sums.size(); ++lane) {
      sums[lane] += values[j + lane];
    }
  }
  double total = 0.0;
  for (; j < values.size(); ++j) {
    total += static_cast<double>(values[j]);
  }
  for (const float sum : sums) {
    total += static_cast<double>(sum);
  }
  return total;
}

// Appends the pixels of [first, first + misfits.size()) that have to climb.
void FindClimbers(const Climb& climb, std::span<const float> misfits, size_t first,
                  const NormalField& field, std::vector<size_t>& pixels) {
  if (climb.options.mode == LadderMode::kLeastSquares) {
    return;
  }
  // The limit falls with the number of samples.
  const float lowest =
      climb.limit[std::min<size_t>(climb.input.stack.size(), climb.limit.size() - 1)];
  for (size_t begin = 0; begin < misfits.size(); begin += kBlock) {
    const std::span<const float> block =
        misfits.subspan(begin, std::min(kBlock, misfits.size() - begin));
    int suspects = climb.options.mode == LadderMode::kConsensus ? 1 : 0;
    for (const float misfit : block) {  // without branches: becomes a vector
      suspects |= misfit > lowest ? 1 : 0;
    }
    for (size_t j = 0; suspects != 0 && j < block.size(); ++j) {
      const size_t pixel = first + begin + j;
      if (IsSolved(field, pixel) && NeedsConsensus(climb, field, block[j], pixel)) {
        pixels.push_back(pixel);
      }
    }
  }
}

// Solves listed pixels on rung 2.
void ClimbPixels(const Climb& climb, const ListedPixels& listed, NormalField& field,
                 PieceSummary& summary) {
  const std::vector<size_t>& pixels = listed.pixels;
  const auto albedo = [&](size_t pixel) { return AlbedoAt(field, pixel); };
  const std::vector<Estimate> before = EstimatesAt(field, pixels, albedo);
  std::vector<uint8_t> agreeing(pixels.size());
  if (const FastRows* fast = climb.rows.Fast(); fast != nullptr) {
    fast->SolveConsensus(listed, field, agreeing);
    if (climb.options.least_squares.backend == Backend::kAuto) {
      SolveRefusedInDouble(climb, pixels, field, agreeing);
    }
  } else {
    SolveConsensusInDouble(climb, pixels, field, agreeing);
  }
  JudgeConsensus(pixels, before, EstimatesAt(field, pixels, albedo), agreeing, field, summary);
}

// Gives rung 3 to the pixels from `first` on that the scene's lobe explains, unless rung 1 explains
// them better.
void SolveUnderLobe(const Climb& climb, size_t first, std::span<const float> misfits,
                    NormalField& field, PieceSummary& summary) {
  PixelSystem system(climb.input, climb.options.least_squares);
  const auto width = static_cast<size_t>(field.reason.width);
  for (size_t j = 0; j < misfits.size(); ++j) {
    const size_t pixel = first + j;
    const auto column = static_cast<int>(pixel % width);
    const auto row = static_cast<int>(pixel / width);
    const std::optional<Eigen::Vector3d> v =
        IsSolved(field, pixel) ? ViewOf(climb.input.rig, column, row) : std::nullopt;
    if (!v) {
      continue;
    }
    system.Gather(column, row);
    const LobeSamples samples =
        LobeSamplesOf(system, climb.noise, climb.scale_squared, *v,
                      static_cast<double>(climb.limit[field.samples.pixels[pixel]]));
    const LobeAnswer answer = SolveLobe(samples, *climb.lobe);
    if (answer.n.isZero() || !(answer.misfit <= samples.limit)) {
      continue;
    }
    const Eigen::Vector3f albedo = answer.albedo.cast<float>();
    const float luminance =
        kLuminance[0] * albedo[0] + kLuminance[1] * albedo[1] + kLuminance[2] * albedo[2];
    const Estimate of_rung_1 = EstimatesAt(field, std::span(&pixel, 1), [&](size_t p) {
                                 return AlbedoAt(field, p);
                               }).front();
    if (TakesLobe(answer, luminance, climb.lobe->share,
                  static_cast<double>(misfits[j]) / climb.scale_squared, of_rung_1, field, pixel)) {
      for (size_t c = 0; c < 3; ++c) {
        field.albedo[c].pixels[pixel] = albedo[static_cast<Eigen::Index>(c)];
      }
      ++summary.lobe;
    }
  }
}

// Solves rows [begin, end) on rungs 1 and 3; appends the pixels that have to climb.
void SolvePiece(const Climb& climb, int begin, int end, NormalField& field, PieceSummary& summary,
                ListedPixels& climbers) {
  const PixelGeometry geometry = climb.rows.GeometryOf(begin, end);
  const size_t first = field.reason.Index(0, begin);
  const size_t count = field.reason.Index(0, end) - first;
  const auto memory = std::make_unique_for_overwrite<float[]>(count);
  const std::span<float> misfits(memory.get(), count);
  climb.rows.SolveWeighted(begin, end, geometry, std::sqrt(climb.scale_squared), field, misfits,
                           summary.counts);
  if (climb.lobe) {
    summary.lobe_seconds +=
        SecondsOf([&] { SolveUnderLobe(climb, first, misfits, field, summary); });
  }
  for (int row = begin; climb.light_doubt && row < end; ++row) {
    climb.light_doubt->AddToRow(row, field.reason.Index(0, row), field);
  }
  for (size_t p = first; climb.lobe && p < first + count; ++p) {
    summary.lobe_deg += field.model.pixels[p] == static_cast<uint8_t>(Rung::kLobe)
                            ? static_cast<double>(field.uncertainty.pixels[p])
                            : 0.0;
  }
  summary.unchecked += CountOf(static_cast<uint8_t>(Rung::kUnchecked),
                               std::span(field.model.pixels).subspan(first, count));
  for (size_t p = 0; p < count; p += kSumBlock) {
    summary.least_squares_deg += SumOf(
        std::span(field.uncertainty.pixels).subspan(first + p, std::min(kSumBlock, count - p)));
  }
  std::vector<size_t> pixels;
  FindClimbers(climb, misfits, first, field, pixels);
  for (const size_t pixel : pixels) {
    summary.least_squares_deg -= static_cast<double>(field.uncertainty.pixels[pixel]);
  }
  climbers.Append(geometry, first, pixels);
}

}  // namespace

Climb MakeClimb(const FramesInput& input, const LadderOptions& options,
                const LeastSquaresRows& rows, const StackNoise& noise, double scale_squared) {
  return {input,
          options,
          rows,
          noise,
          scale_squared,
          MisfitLimits(scale_squared, options.climb.false_alarms),
          LightDoubt::Make(input.rig, input.stack[0].rgb.Size()),
          std::nullopt};
}

int RowsPerClimb(ImageSize size) {
  const int rows = RowsPerPiece(size);
  return rows * std::clamp(size.height / (rows * kFewestClimbs), 1, kPiecesPerClimb);
}

PieceSummary SolveAndClimb(const Climb& climb, int begin, int end, NormalField& field) {
  PieceSummary summary;
  ListedPixels climbers;
  const int step = RowsPerPiece(field.reason.Size());
  for (int row = begin; row < end; row += step) {
    SolvePiece(climb, row, std::min(end, row + step), field, summary, climbers);
  }
  summary.least_squares_deg -= summary.lobe_deg;
  summary.least_squares = summary.counts.solved - summary.unchecked - summary.lobe -
                          static_cast<int64_t>(climbers.pixels.size());
  if (!climbers.pixels.empty()) {
    summary.climbing_seconds = SecondsOf([&] { ClimbPixels(climb, climbers, field, summary); });
  }
  return summary;
}

}  // namespace sateen
