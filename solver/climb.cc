#include "solver/climb.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "core/angle.h"
#include "imaging/color.h"
#include "solver/consensus.h"
#include "solver/noise.h"
#include "solver/plain_ladder.h"

namespace sateen {
namespace {

constexpr size_t kBlock = 256;  // pixels that are looked at together
constexpr float kUnexplainedFactor = 3.0F;

bool NeedsConsensus(const Climb& climb, const NormalField& field, float misfit, size_t pixel) {
  if (field.samples.pixels[pixel] <= 3) {
    return false;  // three samples always agree
  }
  if (climb.options.mode != LadderMode::kAuto) {
    return climb.options.mode == LadderMode::kConsensus;
  }
  if (misfit <= climb.limit[field.samples.pixels[pixel]]) {
    return false;
  }
  const float albedo = kLuminance[0] * field.albedo[0].pixels[pixel] +
                       kLuminance[1] * field.albedo[1].pixels[pixel] +
                       kLuminance[2] * field.albedo[2].pixels[pixel];
  return field.residual.pixels[pixel] >
         static_cast<float>(climb.options.explained_residual) * albedo;
}

Eigen::Vector3f NormalAt(const NormalField& field, size_t pixel) {
  return {field.normal[0].pixels[pixel], field.normal[1].pixels[pixel],
          field.normal[2].pixels[pixel]};
}

// As FastRows::SolveConsensus, in double.
void SolveConsensusInDouble(const Climb& climb, std::span<const size_t> pixels, NormalField& field,
                            std::span<uint8_t> agreeing) {
  PixelSystem system(climb.stack, climb.rig, climb.options.least_squares);
  const auto width = static_cast<size_t>(field.reason.width);
  for (size_t j = 0; j < pixels.size(); ++j) {
    const size_t pixel = pixels[j];
    system.Gather(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
    const PlainAnswer answer = PlainConsensus(system, climb.options.least_squares.max_condition);
    const Eigen::Vector3d n = answer.n.stableNormalized();
    if (!n.allFinite() || n.isZero()) {
      agreeing[j] = 0;
      continue;
    }
    for (size_t c = 0; c < 3; ++c) {
      const auto column = static_cast<Eigen::Index>(c);
      field.normal[c].pixels[pixel] = static_cast<float>(n[column]);
      field.albedo[c].pixels[pixel] = static_cast<float>(answer.n_rgb.col(column).norm());
    }
    field.residual.pixels[pixel] = static_cast<float>(answer.residual);
    field.uncertainty.pixels[pixel] = static_cast<float>(std::min(answer.uncertainty_deg, 180.0));
    agreeing[j] = static_cast<uint8_t>(std::min(answer.agreeing, 255));
  }
}

// What float refused, once more in double.
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

// Rung 1's word on pixels [begin, end); appends those that have to climb to `pixels`.
void KeepOrClimb(const Climb& climb, std::span<const float> all_misfits, size_t first, size_t begin,
                 size_t end, NormalField& field, PieceSummary& summary,
                 std::vector<size_t>& pixels) {
  const bool always = climb.options.mode == LadderMode::kConsensus;
  const bool never = climb.options.mode == LadderMode::kLeastSquares;
  const auto scale = static_cast<float>(std::sqrt(climb.scale_squared));
  const float lowest = *std::min_element(climb.limit.begin(), climb.limit.end());
  const uint8_t* const reason = field.reason.pixels.data();
  const uint8_t* const samples = field.samples.pixels.data();
  const float* const misfits = all_misfits.data() - first;
  uint8_t* const model = field.model.pixels.data();
  float* const uncertainty = field.uncertainty.pixels.data();
  constexpr auto kSolvedCode = static_cast<uint8_t>(Reason::kSolved);
  // Without branches, so that these become vectors.
  for (size_t p = begin; p < end; ++p) {
    const Rung rung = samples[p] <= 3 ? Rung::kUnchecked : Rung::kLeastSquares;
    model[p] = reason[p] == kSolvedCode ? static_cast<uint8_t>(rung) : uint8_t{0};
  }
  int solved = 0;
  int unchecked = 0;
  for (size_t p = begin; p < end; ++p) {
    solved += reason[p] == kSolvedCode ? 1 : 0;
    unchecked += model[p] == static_cast<uint8_t>(Rung::kUnchecked) ? 1 : 0;
  }
  int suspects = always ? 1 : 0;
  for (size_t p = begin; p < end; ++p) {
    // In this order the minimum of 180 and not-a-number, of an infinite scale, is 180.
    uncertainty[p] = reason[p] == kSolvedCode ? std::min(180.0F, uncertainty[p] * scale) : 0.0F;
    suspects |= misfits[p] > lowest ? 1 : 0;
  }
  double sum_deg = 0.0;
  for (size_t p = begin; p < end; ++p) {
    sum_deg += static_cast<double>(uncertainty[p]);  // zero where unsolved
  }
  if (suspects != 0 && !never) {
    for (size_t p = begin; p < end; ++p) {
      if (IsSolved(field, p) && NeedsConsensus(climb, field, misfits[p], p)) {
        pixels.push_back(p);
        --solved;
        sum_deg -= static_cast<double>(uncertainty[p]);
      }
    }
  }
  summary.least_squares += solved - unchecked;
  summary.unchecked += unchecked;
  summary.least_squares_deg += sum_deg;
}

// Rung 2 for the pixels of one piece.
void ClimbPixels(const Climb& climb, int begin, const FastRows::Geometry& geometry,
                 std::span<const size_t> pixels, NormalField& field, PieceSummary& summary) {
  std::vector<Eigen::Vector3f> before;
  before.reserve(pixels.size());
  for (const size_t pixel : pixels) {
    before.push_back(NormalAt(field, pixel));
  }
  std::vector<uint8_t> agreeing(pixels.size());
  if (const FastRows* fast = climb.rows.Fast(); fast != nullptr) {
    fast->SolveConsensus(begin, geometry, pixels, field, agreeing);
    if (climb.options.least_squares.backend == Backend::kAuto) {
      SolveRefusedInDouble(climb, pixels, field, agreeing);
    }
  } else {
    SolveConsensusInDouble(climb, pixels, field, agreeing);
  }
  for (size_t j = 0; j < pixels.size(); ++j) {
    const bool explained = agreeing[j] >= kFewestAgreeing;
    float& uncertainty = field.uncertainty.pixels[pixels[j]];
    if (!explained) {
      uncertainty = std::min(180.0F, uncertainty * kUnexplainedFactor);
      ++summary.unexplained;
    }
    field.model.pixels[pixels[j]] =
        static_cast<uint8_t>(explained ? Rung::kConsensus : Rung::kUnexplained);
    const Eigen::Vector3f after = NormalAt(field, pixels[j]);
    summary.turned_deg += std::atan2(static_cast<double>(before[j].cross(after).norm()),
                                     static_cast<double>(before[j].dot(after))) *
                          kDegPerRad;
    summary.robust_deg += static_cast<double>(uncertainty);
  }
  summary.robust += static_cast<int64_t>(pixels.size());
}

}  // namespace

Climb MakeClimb(const LightStack& stack, const Rig& rig, const LadderOptions& options,
                const LeastSquaresRows& rows, double scale_squared) {
  Climb climb{stack, rig, options, rows, scale_squared};
  climb.limit.fill(std::numeric_limits<float>::infinity());
  for (size_t usable = 4; usable < climb.limit.size(); ++usable) {
    climb.limit[usable] =
        static_cast<float>(scale_squared * ChiSquaredQuantile(1.0 - options.false_alarms,
                                                              static_cast<int>(usable) - 3));
  }
  return climb;
}

void PieceSummary::Add(const PieceSummary& other) {
  AddCounts(other.counts, counts);
  least_squares += other.least_squares;
  robust += other.robust;
  unexplained += other.unexplained;
  unchecked += other.unchecked;
  least_squares_deg += other.least_squares_deg;
  robust_deg += other.robust_deg;
  turned_deg += other.turned_deg;
  climbing_seconds += other.climbing_seconds;
}

PieceSummary SolveAndClimb(const Climb& climb, int begin, int end, NormalField& field) {
  PieceSummary summary;
  const FastRows::Geometry geometry = climb.rows.GeometryOf(begin, end);
  const size_t first = field.reason.Index(0, begin);
  const size_t last = field.reason.Index(0, end);
  std::vector<float> misfits(last - first);
  climb.rows.SolveWeighted(begin, end, geometry, field, misfits, summary.counts);
  std::vector<size_t> pixels;
  for (size_t p = first; p < last; p += kBlock) {
    KeepOrClimb(climb, misfits, first, p, std::min(p + kBlock, last), field, summary, pixels);
  }
  if (!pixels.empty()) {
    const auto start = std::chrono::steady_clock::now();
    ClimbPixels(climb, begin, geometry, pixels, field, summary);
    summary.climbing_seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  return summary;
}

}  // namespace sateen
