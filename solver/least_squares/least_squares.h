#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "solver/lambertian.h"
#include "solver/least_squares/fast_rows.h"
#include "solver/noise.h"

namespace sateen {

// Misfits of some pixels and the numbers of their usable samples, 0 where a pixel is unsolved.
struct MisfitSample {
  std::vector<size_t> pixels;
  std::vector<float> misfits;
  std::vector<uint8_t> samples;
};

// Solves rows by (3) of solver/lambertian.h with the chosen backend and, with noise, by rung 1
// (solver/least_squares/weighted.h). Borrows its arguments for the time of one solve.
class LeastSquaresRows {
 public:
  // Fails as SolveLambertian does. `noise` null: without weights.
  [[nodiscard]] static Result<LeastSquaresRows> Make(const FramesInput& input,
                                                     const LambertianOptions& options,
                                                     const StackNoise* noise);

  // Returns the geometry that the fast backends need of these rows; empty for the others.
  [[nodiscard]] PixelGeometry GeometryOf(int begin, int end) const;
  // Solves rows [begin, end) into `field` and counts them in `counts`.
  void Solve(int begin, int end, NormalField& field, SolveSummary& counts) const;
  // Solves with weights: also writes both uncertainties for this s, field.model and the misfit of
  // each pixel.
  void SolveWeighted(int begin, int end, const PixelGeometry& geometry, double noise_scale,
                     NormalField& field, std::span<float> misfits, SolveSummary& counts) const;
  // Computes the misfits of sample.pixels, which are in order of their indices and inside the mask.
  void FindMisfits(MisfitSample& sample) const;
  // Returns null for the double backends.
  [[nodiscard]] const FastRows* Fast() const { return fast_.get(); }

 private:
  LeastSquaresRows(const FramesInput& input, const LambertianOptions& options,
                   const StackNoise* noise)
      : input_(input), options_(&options), noise_(noise) {}
  // Solves the pixels that the fast backend left, or all, in double. Returns how many it left.
  int64_t SolvePending(int begin, int end, double noise_scale, NormalField& field,
                       std::span<float> misfits) const;

  FramesInput input_;
  const LambertianOptions* options_;
  const StackNoise* noise_;
  std::unique_ptr<const FastRows> fast_;
};

// Counts the bytes that are `value`.
[[nodiscard]] int64_t CountOf(uint8_t value, std::span<const uint8_t> bytes);

// Adds the pixels of each reason inside the mask to the counts.
void CountReasons(std::span<const uint8_t> reasons, SolveSummary& counts);
// Adds the counts of one piece.
void AddCounts(const SolveSummary& piece, SolveSummary& total);
// Fills in the fields that follow from the counts and the options.
void FinishSummary(const LambertianOptions& options, const Task& task, SolveSummary& summary);

}  // namespace sateen
