#pragma once

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "simulation/scene.h"

namespace sateen {

// Applies the effect of the lens on radiance on its way to the sensor: the vignetting and the point
// spread of `lens`. At the border the picture continues as its outermost row or column.
[[nodiscard]] Status ApplyOptics(const Lens& lens, Image3& radiance, const Task& task = {});

}  // namespace sateen
