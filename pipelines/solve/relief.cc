#include "pipelines/solve/relief.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "core/stopwatch.h"
#include "pipelines/solve/solve.h"
#include "pipelines/solve/solve_frames.h"
#include "solver/height.h"

namespace sateen {
namespace {

// Moves the heights by `above_mm` and notes the lowest and highest of the solved pixels.
void TakeHeights(Image<float> height_mm, double above_mm, const NormalField& field,
                 ReliefOutcome& relief) {
  relief.lowest_mm = std::numeric_limits<double>::infinity();
  relief.highest_mm = -relief.lowest_mm;
  for (size_t p = 0; p < height_mm.pixels.size(); ++p) {
    height_mm.pixels[p] += static_cast<float>(above_mm);
    if (IsSolved(field, p)) {
      const auto here_mm = static_cast<double>(height_mm.pixels[p]);
      relief.lowest_mm = std::min(relief.lowest_mm, here_mm);
      relief.highest_mm = std::max(relief.highest_mm, here_mm);
    }
  }
  relief.height_mm = std::move(height_mm);
}

}  // namespace

Result<ReliefOutcome> SolveAtHeights(const SolveOptions& options, const Dataset& dataset,
                                     const Task& task, NormalField& field) {
  const Stopwatch stopwatch;
  Result<Image<float>> integrated = IntegrateNormals(field, *dataset.rig.camera, task);
  if (!integrated) {
    return tl::unexpected(integrated.error());
  }
  std::optional<Image<float>> height_mm = *std::move(integrated);
  ReliefOutcome relief{.seconds = stopwatch.Seconds()};
  Result<NormalField> again = SolveFrames(options, dataset, height_mm, task);
  if (!again) {
    return tl::unexpected(again.error());
  }
  const Result<ErrorStatistics> turned = AngularErrorDeg(*again, field.normal);
  if (!turned) {
    return tl::unexpected(turned.error());
  }
  relief.turned_deg = *turned;
  TakeHeights(*std::move(height_mm), options.height_mm, *again, relief);
  field = *std::move(again);
  return relief;
}

}  // namespace sateen
