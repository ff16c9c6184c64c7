#pragma once

#include <optional>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "scanner/sessions/dataset.h"
#include "solver/normal_field.h"

namespace sateen {

struct SolveOptions;

// Solves the frames of a capture, mosaics or interpolated colours, by the ladder or by least
// squares alone, as `options` say. `height_mm` is each pixel's height above the surface plane;
// nothing: 0.
[[nodiscard]] Result<NormalField> SolveFrames(const SolveOptions& options, const Dataset& dataset,
                                              const std::optional<Image<float>>& height_mm,
                                              const Task& task);

}  // namespace sateen
