#pragma once

#include <cstddef>

#include "core/error.h"
#include "core/task.h"
#include "imaging/light_stack.h"
#include "solver/normal_field.h"

namespace sateen {

// Reads rows [begin, end) of all frames and writes the maps of plain least squares, in the order in
// which the fast backend does; only adds the samples up. `field` has the size of the frames.
void TouchRows(const LightStack& stack, int begin, int end, NormalField& field);

// Touches a whole image: the time that SolveLambertian would take if memory were the only cost.
[[nodiscard]] Status TouchAllRows(const LightStack& stack, const Task& task, NormalField& field);

// Returns the bytes that the fast backend and TouchRows read and write per pixel.
[[nodiscard]] size_t BytesPerPixel(size_t light_count);

}  // namespace sateen
