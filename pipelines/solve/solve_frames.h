#pragma once

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "scanner/sessions/dataset.h"
#include "solver/lambertian.h"

namespace sateen {

struct SolveOptions;

// Solves the frames of a capture, mosaics or interpolated colours, by the ladder or by least
// squares alone, as `options` say. `height_mm` is each pixel's height above the surface plane; null:
// 0.
[[nodiscard]] Result<NormalField> SolveFrames(const SolveOptions& options, const Dataset& dataset,
                                              const Image<float>* height_mm, const Task& task);

}  // namespace sateen
