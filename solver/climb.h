#pragma once

#include <array>
#include <cstdint>

#include "solver/ladder.h"
#include "solver/least_squares.h"
#include "solver/sheen.h"

namespace sateen {

// What every pixel of a ladder's stack is judged by.
struct Climb {
  const LightStack& stack;
  const Rig& rig;
  const LadderOptions& options;
  const LeastSquaresRows& rows;
  const StackNoise& noise;
  double scale_squared = 1.0;         // s^2
  std::array<float, 256> limit = {};  // of the misfit, by usable samples
  std::optional<Sheen> sheen;
};

// The limits of equation (5)'s misfits.
[[nodiscard]] Climb MakeClimb(const LightStack& stack, const Rig& rig, const LadderOptions& options,
                              const LeastSquaresRows& rows, const StackNoise& noise,
                              double scale_squared);

// What one piece adds to the summary.
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

// All rungs for rows [begin, end), while their samples are in the cache.
[[nodiscard]] PieceSummary SolveAndClimb(const Climb& climb, int begin, int end,
                                         NormalField& field);

}  // namespace sateen
