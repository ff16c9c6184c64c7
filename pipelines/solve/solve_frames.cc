#include "pipelines/solve/solve_frames.h"

#include "pipelines/solve/solve.h"
#include "solver/ladder.h"
#include "solver/mosaic/mosaic.h"

namespace sateen {

Result<NormalField> SolveFrames(const SolveOptions& options, const Dataset& dataset,
                                const Image<float>* height_mm, const Task& task) {
  LambertianOptions least_squares = options.least_squares;
  least_squares.height_mm = height_mm;
  if (dataset.mosaics) {
    return SolveMosaic(dataset.mosaics->stack, dataset.rig, dataset.mask,
                       {.mode = options.robust, .least_squares = least_squares}, task);
  }
  if (!options.robust) {
    return SolveLambertian(dataset.stack, dataset.rig, dataset.mask, least_squares, task);
  }
  return SolveLadder(dataset.stack, dataset.rig, dataset.mask,
                     {.mode = *options.robust,
                      .least_squares = least_squares,
                      .noise = NoiseOf(dataset.stack, dataset.rig)},
                     task);
}

}  // namespace sateen
