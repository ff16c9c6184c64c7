#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "solver/lambertian.h"

// What the ladders of solver/ladder.h and solver/mosaic.h share: how a pixel's rungs are judged, and what
// is said of them.
namespace sateen {

// What one piece of an image adds to the summary.
struct PieceSummary {
  SolveSummary counts;
  int64_t least_squares = 0;
  int64_t robust = 0;
  int64_t sheen = 0;
  int64_t unexplained = 0;
  int64_t unchecked = 0;
  double least_squares_deg = 0.0;  // sums
  double robust_deg = 0.0;
  double sheen_deg = 0.0;
  double turned_deg = 0.0;
  double climbing_seconds = 0.0;
  double sheen_seconds = 0.0;

  void Add(const PieceSummary& other);
};

// Largest misfit that noise explains, by usable samples: (5) of solver/ladder.h times s^2.
[[nodiscard]] std::array<float, 256> MisfitLimits(double scale_squared, double false_alarms);

[[nodiscard]] std::vector<Eigen::Vector3f> NormalsAt(const NormalField& field,
                                                     std::span<const size_t> pixels);

// After the search for a consensus: (12) of solver/ladder.h and the rung of each pixel, from its normal
// before and how many samples agree now; 0: the search has no answer.
void JudgeConsensus(std::span<const size_t> pixels, std::span<const Eigen::Vector3f> before,
                    std::span<const uint8_t> agreeing, NormalField& field, PieceSummary& summary);

// What the uncertainty of rung 1 owes to a model that is wrong for many pixels, in degrees: where from 2
// to 20 of 100 climb, 0 to all of the error of those that do.
struct Doubt {
  float checked_deg = 0.0F;
  float unchecked_deg = 0.0F;  // what nothing could check is as wrong as those that climbed were

  [[nodiscard]] bool IsNone() const { return checked_deg == 0.0F; }
  [[nodiscard]] float Of(float uncertainty_deg, Rung rung) const;
};
[[nodiscard]] Doubt DoubtOf(const PieceSummary& total);

[[nodiscard]] double SecondsOf(const std::function<void()>& work);

// From sums to the summary, whose `seconds` and `threads` are there.
void ReportRungs(const PieceSummary& total, SolveSummary& summary);

}  // namespace sateen
