#include "pipelines/solve/solve_frames.h"

#include "pipelines/solve/solve.h"
#include "solver/ladder.h"
#include "solver/mosaic/mosaic.h"

namespace sateen {

Result<NormalField> SolveFrames(const SolveOptions& options, const Dataset& dataset,
                                const std::optional<Image<float>>& height_mm, const Task& task) {
  if (dataset.mosaics) {
    return SolveMosaic(dataset.mosaics->stack, dataset.rig, dataset.mask,
                       {.mode = options.robust, .least_squares = options.least_squares}, task,
                       height_mm);
  }
  if (!options.robust) {
    return SolveLambertian(dataset.stack, dataset.rig, dataset.mask, options.least_squares, task,
                           height_mm);
  }
  return SolveLadder(dataset.stack, dataset.rig, dataset.mask,
                     {.mode = *options.robust,
                      .least_squares = options.least_squares,
                      .noise = NoiseOf(dataset.stack, dataset.rig)},
                     task, height_mm);
}

}  // namespace sateen
