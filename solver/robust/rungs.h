#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "imaging/color.h"
#include "solver/lambertian.h"
#include "solver/lobe/lobe.h"

// Judgement of a pixel's rungs and their summary, shared by the ladders of solver/ladder.h and
// solver/mosaic/mosaic.h.
namespace sateen {

// Counts and sums of one piece of an image.
struct PieceSummary {
  SolveSummary counts;
  int64_t least_squares = 0;
  int64_t robust = 0;
  int64_t lobe = 0;
  int64_t unexplained = 0;
  int64_t unchecked = 0;
  double least_squares_deg = 0.0;  // sums of the uncertainties, ...
  double robust_deg = 0.0;
  double lobe_deg = 0.0;
  double turned_deg = 0.0;  // ... and of the changes by rung 2
  double albedo_change = 0.0;
  double climbing_seconds = 0.0;
  double lobe_seconds = 0.0;

  void Add(const PieceSummary& other);
};

// Returns the largest misfits that noise explains, by usable samples: (1) of solver/ladder.h.
[[nodiscard]] std::array<float, 256> MisfitLimits(double scale_squared, double false_alarms);

// Returns the albedo's luminance.
[[nodiscard]] inline float AlbedoAt(const NormalField& field, size_t pixel) {
  return kLuminance[0] * field.albedo[0].pixels[pixel] +
         kLuminance[1] * field.albedo[1].pixels[pixel] +
         kLuminance[2] * field.albedo[2].pixels[pixel];
}

// Answer of a rung for a pixel.
struct Estimate {
  Eigen::Vector3f n;
  float albedo;  // of luminance, or of a site's own colour
};
[[nodiscard]] std::vector<Estimate> EstimatesAt(const NormalField& field,
                                                std::span<const size_t> pixels,
                                                const std::function<float(size_t)>& albedo);

// Computes (7) of solver/robust/consensus.h and the rung of each pixel after the search for a
// consensus, from the estimates before and after it and the number of samples that agree; 0: no
// answer.
void JudgeConsensus(std::span<const size_t> pixels, std::span<const Estimate> before,
                    std::span<const Estimate> after, std::span<const uint8_t> agreeing,
                    NormalField& field, PieceSummary& summary);

// Uncertainty of rung 1 due to a model that is wrong for many pixels: where 2 to 20 % of them
// climb, 0 to all of the error of those that do.
struct Doubt {
  float checked_deg = 0.0F;
  float checked_albedo = 0.0F;
  float unchecked_deg = 0.0F;  // of three samples: as wrong as the pixels that climbed were
  float unchecked_albedo = 0.0F;

  [[nodiscard]] bool IsNone() const { return checked_deg == 0.0F; }
  // Adds to both uncertainties of a pixel of rung 1.
  void AddTo(NormalField& field, size_t pixel) const;
};
[[nodiscard]] Doubt DoubtOf(const PieceSummary& total);

// Returns whether a solved pixel takes rung 3's answer, by (3) of solver/lobe/lobe.h; if so, writes
// its normal, residual, uncertainties and rung. misfit_of_rung_1 is chi^2 over its degrees of
// freedom, s^2 included. In either case adds to both uncertainties the difference of the two
// answers times the root of the probability of the other one.
[[nodiscard]] bool TakesLobe(const LobeAnswer& answer, float albedo_of_lobe, double share,
                             double misfit_of_rung_1, const Estimate& of_rung_1, NormalField& field,
                             size_t pixel);

// Returns the seconds that `work` takes.
[[nodiscard]] double SecondsOf(const std::function<void()>& work);

// Turns sums into the summary, whose `seconds` and `threads` must be set.
void ReportRungs(const PieceSummary& total, SolveSummary& summary);

}  // namespace sateen
