// Readings of a vector of sites of a row, for solver/kernels/mosaic_kernel.cc: equation (1) of
// solver/mosaic/mosaic.h. Compiled once per instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_MOSAIC_GATHER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_MOSAIC_GATHER_INL_H_
#undef SATEEN_SOLVER_MOSAIC_GATHER_INL_H_
#else
#define SATEEN_SOLVER_MOSAIC_GATHER_INL_H_
#endif

#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>

#include "solver/kernels/fast_kernel_gather-inl.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/kernels/mosaic_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {

// Scratch vectors of one light: l, i', and the factor from radiance to i'.
constexpr size_t kMosaicScratch = 5;

// Vectors of a light's constants for the sites of a row, which alternate between two of the
// pattern.
enum SiteFigure : size_t {
  kInverseFlux,
  kPerDn,
  kAtZero,
  kLeast,
  kShot,
  kReadSquared,
  kSiteFigures
};

struct RowState {
  hwy::AlignedFreeUniquePtr<float[]> scratch;
  hwy::AlignedFreeUniquePtr<float[]> figures;  // [light][figure], for even, then for odd offsets

  [[nodiscard]] HWY_INLINE const float* FiguresOf(size_t k, size_t lights, size_t offset) const {
    return figures.get() + ((offset % 2) * lights + k) * kSiteFigures * hn::Lanes(D());
  }
};

inline RowState RowStateFor(const MosaicKernelParams& params, int row) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const size_t lights = params.lights.size();
  RowState state{hwy::AllocateAligned<float>(lights * kMosaicScratch * lanes),
                 hwy::AllocateAligned<float>(2 * lights * kSiteFigures * lanes)};
  float* to = state.figures.get();
  for (size_t shift = 0; shift < 2; ++shift) {
    for (const MosaicKernelLight& light : params.lights) {
      for (const BySite* figure : {&light.inverse_flux, &light.per_dn, &light.at_zero, &light.least,
                                   &light.shot, &light.read_squared}) {
        for (size_t lane = 0; lane < lanes; ++lane) {
          *to++ = (*figure)[static_cast<size_t>(row % 2) * 2 + (lane + shift) % 2];
        }
      }
    }
  }
  return state;
}

HWY_INLINE V FigureOf(const float* figures, SiteFigure figure) {
  return hn::Load(D(), figures + static_cast<size_t>(figure) * hn::Lanes(D()));
}

HWY_INLINE V LoadReadings(const uint16_t* from) {
  const D d;
  const hn::Rebind<uint16_t, D> du16;
  return hn::ConvertTo(d, hn::PromoteTo(DI(), hn::LoadU(du16, from)));
}

struct Readings {
  V brightest;  // largest i'_k that is not saturated
  V saturated;  // number of saturated readings
  M bright;     // some reading is above its dark level
};

// Fills the scratch. i' is -1 where the reading is saturated.
template <bool kDistant>
HWY_INLINE Readings GatherReadings(const MosaicKernelParams& params, const MosaicKernelInput& input,
                                   size_t offset, const RowState& state) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  Readings readings{zero, zero, NoLanes()};
  const Vector3 x_mm = PointsAt<kDistant>(input, offset);
  const V dark = input.dark != nullptr ? hn::LoadU(d, input.dark + offset) : zero;
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const MosaicKernelLight& light = params.lights[k];
    const V reading = LoadReadings(input.readings[k] + offset);
    const M clipped = hn::Ge(reading, hn::Set(d, light.clip_dn));
    const float* figures = state.FiguresOf(k, params.lights.size(), offset);
    const V inverse_flux = FigureOf(figures, kInverseFlux);
    const V radiance = hn::NegMulAdd(
        inverse_flux, dark,
        hn::MulAdd(FigureOf(figures, kPerDn), reading, FigureOf(figures, kAtZero)));  // f i
    const Incoming in = IncomingAt<false>(light.lamp, x_mm, GainsOf(input, k, offset));
    const V kept = hn::IfThenElse(clipped, hn::Set(d, -1.0F), hn::Mul(radiance, in.inverse_gain));
    readings.brightest = hn::Max(readings.brightest, kept);
    readings.saturated = hn::Add(readings.saturated, hn::IfThenElseZero(clipped, hn::Set(d, 1.0F)));
    readings.bright =
        hn::Or(readings.bright, hn::Or(clipped, hn::Gt(radiance, FigureOf(figures, kLeast))));
    float* HWY_RESTRICT slot = state.scratch.get() + k * kMosaicScratch * lanes;
    hn::Store(in.l.x, d, slot);
    hn::Store(in.l.y, d, slot + lanes);
    hn::Store(in.l.z, d, slot + 2 * lanes);
    hn::Store(kept, d, slot + 3 * lanes);
    hn::Store(hn::Mul(inverse_flux, in.inverse_gain), d, slot + 4 * lanes);
  }
  return readings;
}

// l and i' of one light where its reading is usable, zero elsewhere.
struct Usable {
  M is;
  Vector3 l;
  V i;
};

HWY_INLINE Usable UsableOf(const float* slot, V threshold) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V i = hn::Load(d, slot + 3 * lanes);
  const M is = hn::Gt(i, threshold);
  return {
      is,
      {hn::IfThenElseZero(is, hn::Load(d, slot)), hn::IfThenElseZero(is, hn::Load(d, slot + lanes)),
       hn::IfThenElseZero(is, hn::Load(d, slot + 2 * lanes))},
      hn::IfThenElseZero(is, i)};
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
