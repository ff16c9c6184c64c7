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

// What the ladders of solver/ladder.h and solver/mosaic/mosaic.h share: how a pixel's rungs are judged, and what
// is said of them.
namespace sateen {

// What one piece of an image adds to the summary.
struct PieceSummary {
  SolveSummary counts;
  int64_t least_squares = 0;
  int64_t robust = 0;
  int64_t lobe = 0;
  int64_t unexplained = 0;
  int64_t unchecked = 0;
  double least_squares_deg = 0.0;  // sums
  double robust_deg = 0.0;
  double lobe_deg = 0.0;
  double turned_deg = 0.0;
  double albedo_change = 0.0;
  double climbing_seconds = 0.0;
  double lobe_seconds = 0.0;

  void Add(const PieceSummary& other);
};

// Largest misfit that noise explains, by usable samples: (5) of solver/ladder.h times s^2.
[[nodiscard]] std::array<float, 256> MisfitLimits(double scale_squared, double false_alarms);

// Of luminance.
[[nodiscard]] inline float AlbedoAt(const NormalField& field, size_t pixel) {
  return kLuminance[0] * field.albedo[0].pixels[pixel] +
         kLuminance[1] * field.albedo[1].pixels[pixel] +
         kLuminance[2] * field.albedo[2].pixels[pixel];
}

// What a rung says of a pixel.
struct Estimate {
  Eigen::Vector3f n;
  float albedo;  // of luminance, or of a site's own colour
};
[[nodiscard]] std::vector<Estimate> EstimatesAt(const NormalField& field,
                                                std::span<const size_t> pixels,
                                                const std::function<float(size_t)>& albedo);

// After the search for a consensus: (12) of solver/ladder.h and the rung of each pixel, from what was said
// of it before and is now, and how many samples agree now; 0: the search has no answer.
void JudgeConsensus(std::span<const size_t> pixels, std::span<const Estimate> before,
                    std::span<const Estimate> after, std::span<const uint8_t> agreeing,
                    NormalField& field, PieceSummary& summary);

// What the uncertainties of rung 1 owe to a model that is wrong for many pixels: where from 2 to 20 of 100
// climb, 0 to all of the error of those that do.
struct Doubt {
  float checked_deg = 0.0F;
  float checked_albedo = 0.0F;
  float unchecked_deg = 0.0F;  // what nothing could check is as wrong as those that climbed were
  float unchecked_albedo = 0.0F;

  [[nodiscard]] bool IsNone() const { return checked_deg == 0.0F; }
  // For a pixel of rung 1.
  void AddTo(NormalField& field, size_t pixel) const;
};
[[nodiscard]] Doubt DoubtOf(const PieceSummary& total);

// Whether a solved pixel takes rung 3's answer, by the odds of what rung 1 (whose chi^2 over its degrees of
// freedom, s^2 included, this is) and the lobe leave of its samples: then normal, residual, uncertainties and
// rung are the lobe's. What the two differ by counts as much as the other is likely, in both uncertainties.
[[nodiscard]] bool TakesLobe(const LobeAnswer& answer, float albedo_of_lobe, double share,
                             double misfit_of_rung_1, const Estimate& of_rung_1, NormalField& field,
                             size_t pixel);

[[nodiscard]] double SecondsOf(const std::function<void()>& work);

// From sums to the summary, whose `seconds` and `threads` are there.
void ReportRungs(const PieceSummary& total, SolveSummary& summary);

}  // namespace sateen
