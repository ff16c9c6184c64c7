#pragma once

#include <optional>

#include "core/files/output_folder.h"
#include "core/task.h"
#include "imaging/mosaic_stack.h"
#include "pipelines/solve/maps.h"
#include "rig/rig.h"
#include "solver/mosaic/mosaic.h"

namespace sateen {

// Returns a lit frame as balanced radiance, its colours interpolated, for people to look at.
[[nodiscard]] LightFrame ShowFrame(const MosaicStack& stack, size_t frame);

// Solves a stack band by band into maps, so that memory does not grow with its height. `facts`
// belong to the same options.
[[nodiscard]] Result<SolveSummary> SolveIntoMaps(const MosaicStack& stack, const Rig& rig,
                                                 const std::optional<Mask>& mask,
                                                 const MosaicOptions& options,
                                                 const MapsFacts& facts, const Task& task,
                                                 OutputFolder& folder);

}  // namespace sateen
