#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "solver/lambertian.h"
#include "solver/least_squares/fast_rows.h"
#include "solver/noise.h"

namespace sateen {

// Misfits of some pixels, with their usable samples: 0 where a pixel is unsolved.
struct MisfitSample {
  std::vector<size_t> pixels;
  std::vector<float> misfits;
  std::vector<uint8_t> samples;
};

// Equation (3) of solver/lambertian.h by the backend that is asked for and, with noise, rung 1 of
// solver/ladder.h; row by row. Borrows all that it is made of.
class LeastSquaresRows {
 public:
  // Checks everything, as SolveLambertian says. `noise` null: without weights.
  [[nodiscard]] static Result<LeastSquaresRows> Make(const LightStack& stack, const Rig& rig,
                                                     const std::optional<Mask>& mask,
                                                     const LambertianOptions& options,
                                                     const StackNoise* noise);

  // What the fast backends know of these rows; empty for the others.
  [[nodiscard]] PixelGeometry GeometryOf(int begin, int end) const;
  // Solves rows [begin, end) into `field` and counts them in `counts`.
  void Solve(int begin, int end, NormalField& field, SolveSummary& counts) const;
  // With weights: also field.uncertainty, equation (4) with this s, field.model and equation (5) of
  // each pixel.
  void SolveWeighted(int begin, int end, const PixelGeometry& geometry, double noise_scale,
                     NormalField& field, std::span<float> misfits, SolveSummary& counts) const;
  // Equation (5) of sample.pixels, in order of their indices and inside the mask.
  void FindMisfits(MisfitSample& sample) const;
  // Nothing for the double backends.
  [[nodiscard]] const FastRows* Fast() const { return fast_.get(); }

 private:
  LeastSquaresRows(const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                   const LambertianOptions& options, const StackNoise* noise)
      : stack_(&stack), rig_(&rig), mask_(&mask), options_(&options), noise_(noise) {}
  // The pixels that the fast backend left, or all; returns how many it left.
  int64_t SolvePending(int begin, int end, double noise_scale, NormalField& field,
                       std::span<float> misfits) const;

  const LightStack* stack_;
  const Rig* rig_;
  const std::optional<Mask>* mask_;
  const LambertianOptions* options_;
  const StackNoise* noise_;
  std::unique_ptr<const FastRows> fast_;
};

// How many of these are `value`.
[[nodiscard]] int64_t CountOf(uint8_t value, std::span<const uint8_t> bytes);

// Adds the pixels that one piece counted.
void AddCounts(const SolveSummary& piece, SolveSummary& total);
// Fills in what follows from the counts and the options.
void FinishSummary(const LambertianOptions& options, const Task& task, SolveSummary& summary);

}  // namespace sateen
