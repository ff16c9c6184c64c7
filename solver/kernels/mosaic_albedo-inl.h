// Albedo of all colours along a row of a mosaic, for solver/kernels/mosaic_kernel.cc: equation (5)
// of solver/mosaic/mosaic.h. Compiled once per instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_MOSAIC_ALBEDO_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_MOSAIC_ALBEDO_INL_H_
#undef SATEEN_SOLVER_MOSAIC_ALBEDO_INL_H_
#else
#define SATEEN_SOLVER_MOSAIC_ALBEDO_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <vector>

#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/kernels/mosaic_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {

// Sums over the neighbours in three rows: beside, above and below, at the corners.
struct Around {
  V beside, above, corners;
};

// Adds the neighbours; unsolved ones are zero. `count`: counts the solved ones instead.
HWY_INLINE Around SumAround(const float* a, const float* h, const float* b, bool count) {
  const D d;
  const auto load = [&](const float* from) HWY_ATTR {
    const V value = hn::LoadU(d, from);
    return count ? hn::IfThenElseZero(hn::Gt(value, hn::Zero(d)), hn::Set(d, 1.0F)) : value;
  };
  return {hn::Add(load(h - 1), load(h + 1)), hn::Add(load(a), load(b)),
          hn::Add(hn::Add(load(a - 1), load(a + 1)), hn::Add(load(b - 1), load(b + 1)))};
}

// Returns 1 for the neighbours of a colour and 0 for others, at the sites of a vector that begins
// at an even one.
HWY_INLINE Around TakenFor(const std::array<uint8_t, 4>& cfa, int row, size_t colour) {
  const D d;
  const auto pattern = [&](size_t step) HWY_ATTR {
    const auto is = [&](size_t x) {
      return cfa[(static_cast<size_t>(row % 2) * 2 + x) ^ step] == colour ? 1.0F : 0.0F;
    };
    return hn::OddEven(hn::Set(d, is(1)), hn::Set(d, is(0)));
  };
  return {pattern(1), pattern(2), pattern(3)};
}

HWY_INLINE V Total(const Around& taken, const Around& of) {
  return hn::MulAdd(taken.beside, of.beside,
                    hn::MulAdd(taken.above, of.above, hn::Mul(taken.corners, of.corners)));
}

inline void InterpolateAlbedoRowImpl(const std::array<uint8_t, 4>& cfa, int row,
                                     const OwnColours& own, size_t width,
                                     const std::array<float*, 3>& albedo) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  // Each row stands between zeros, with a whole vector of them at the end.
  const size_t padded = (width + lanes - 1) / lanes * lanes + lanes + 1;
  std::vector<float> rows(3 * padded + 3 * lanes, 0.0F);
  const std::array<const float*, 3> from = {own.above, own.row, own.below};
  for (size_t j = 0; j < 3; ++j) {
    if (from[j] != nullptr) {
      std::copy_n(from[j], width, rows.begin() + static_cast<std::ptrdiff_t>(j * padded + 1));
    }
  }
  const float* const a = rows.data() + 1;
  const float* const h = a + padded;
  const float* const b = h + padded;
  float* const spare = rows.data() + 3 * padded;
  const V zero = hn::Zero(d);
  for (size_t x = 0; x < width; x += lanes) {
    const Around sums = SumAround(a + x, h + x, b + x, false);
    const Around counts = SumAround(a + x, h + x, b + x, true);
    const V here = hn::LoadU(d, h + x);
    const bool whole = x + lanes <= width;
    for (size_t c = 0; c < 3; ++c) {
      const Around taken = TakenFor(cfa, row, c);
      const auto is_own = [&](size_t place) {
        return cfa[static_cast<size_t>(row % 2) * 2 + place] == c ? 1.0F : 0.0F;
      };
      const V count = Total(taken, counts);
      const M is_mean =
          hn::And(hn::Gt(count, zero),
                  hn::Eq(hn::OddEven(hn::Set(d, is_own(1)), hn::Set(d, is_own(0))), zero));
      const V mean = hn::Div(Total(taken, sums), hn::Max(count, hn::Set(d, 1.0F)));
      const V value = hn::IfThenElseZero(hn::Gt(here, zero), hn::IfThenElse(is_mean, mean, here));
      hn::StoreU(value, d, whole ? albedo[c] + x : spare + c * lanes);
      if (!whole) {
        std::copy_n(spare + c * lanes, width - x, albedo[c] + x);
      }
    }
  }
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
