#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/error.h"
#include "core/task.h"
#include "solver/lambertian.h"

namespace sateen {

// Own colours of the rows just above and below; empty at the image's border.
struct RowsBeyond {
  std::span<const float> above;
  std::span<const float> below;
};

// field.albedo from the albedo of each site's own colour, rows [first_row, ...) of an image: the own
// colour as it is, another one as the mean of the nearest solved sites of that colour among the eight
// neighbours, the own colour's value where there is none. Zero where the site is not solved.
[[nodiscard]] Status InterpolateAlbedo(const std::array<uint8_t, 4>& cfa, int first_row,
                                       const Image<float>& own_colour, const RowsBeyond& beyond,
                                       const Task& task, NormalField& field);

}  // namespace sateen
