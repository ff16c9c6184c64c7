#pragma once

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "scanner/sessions/dataset.h"
#include "solver/evaluate.h"
#include "solver/lambertian.h"

namespace sateen {

struct SolveOptions;

// Heights that SolveOptions::relief finds.
struct ReliefOutcome {
  Image<float> height_mm;  // above the table plane
  // Lowest and highest solved pixel.
  double lowest_mm = 0.0;
  double highest_mm = 0.0;
  ErrorStatistics turned_deg;  // normals of the second solve against those of the first
  double seconds = 0.0;        // of finding the heights, without either solve
};

// Finds each pixel's height from the normals of `field`, solves `dataset` again with each pixel's
// point at its height, and replaces `field` with the result.
[[nodiscard]] Result<ReliefOutcome> SolveAtHeights(const SolveOptions& options,
                                                   const Dataset& dataset, const Task& task,
                                                   NormalField& field);

}  // namespace sateen
