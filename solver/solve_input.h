#pragma once

#include <optional>

#include "imaging/image.h"
#include "imaging/light_stack.h"
#include "imaging/mosaic_stack.h"
#include "rig/rig.h"

namespace sateen {

// Frames, lights, pixels and heights of one solve. Borrows them, so it lives no longer than the
// call that was given them.
template <typename Stack>
struct SolveInput {
  const Stack& stack;
  const Rig& rig;
  const Mask* mask = nullptr;               // null: all pixels
  const Image<float>* height_mm = nullptr;  // of each pixel's point above the table plane; null: 0

  SolveInput(const Stack& frames, const Rig& lights, const std::optional<Mask>& pixels = {},
             const std::optional<Image<float>>& heights_mm = {})
      : stack(frames),
        rig(lights),
        mask(pixels ? &*pixels : nullptr),
        height_mm(heights_mm ? &*heights_mm : nullptr) {}

  // Returns the same input with other frames.
  [[nodiscard]] SolveInput With(const Stack& frames) const {
    SolveInput input(frames, rig);
    input.mask = mask;
    input.height_mm = height_mm;
    return input;
  }
  [[nodiscard]] bool IsInside(size_t pixel) const {
    return mask == nullptr || mask->pixels[pixel] != 0;
  }
  [[nodiscard]] double HeightAt(int column, int row) const {
    return height_mm == nullptr ? 0.0 : static_cast<double>(height_mm->At(column, row));
  }
};

using FramesInput = SolveInput<LightStack>;
using MosaicInput = SolveInput<MosaicStack>;

}  // namespace sateen
