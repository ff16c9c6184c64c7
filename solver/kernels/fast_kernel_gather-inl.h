// Lights and samples of a vector of pixels, for the passes of solver/kernels/fast_kernel.cc.
// Compiled once per instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_FAST_KERNEL_GATHER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_FAST_KERNEL_GATHER_INL_H_
#undef SATEEN_SOLVER_FAST_KERNEL_GATHER_INL_H_
#else
#define SATEEN_SOLVER_FAST_KERNEL_GATHER_INL_H_
#endif

#include <hwy/aligned_allocator.h>
#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>

#include "imaging/color.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
// Scratch vectors of one light: l (near lights only); i' of red, green, blue and luminance; 1 / g
// (near lights only); N . l. In the weighted step, W and misfit replace red and green.
constexpr size_t kScratchPerLight = 9;

// Floats to prefetch ahead. 3 K streams are more than the hardware prefetchers follow: three cache
// lines ahead, ten near lights take 8.1 instead of 11.5 ns/px on two cores (floor 5.9). Two to four
// lines do as well.
constexpr size_t kPrefetchAhead = 48;

// ---- Pass 1: lights and samples ----------------------------------------------------------------

// Returns the points that the pixels of a vector see.
template <bool kDistant, typename Input>
HWY_INLINE Vector3 PointsAt(const Input& input, size_t offset) {
  const D d;
  const V zero = hn::Zero(d);
  if constexpr (kDistant) {
    return {zero, zero, zero};
  }
  return {hn::LoadU(d, input.x_mm + offset), hn::LoadU(d, input.y_mm + offset),
          input.z_mm == nullptr ? zero : hn::LoadU(d, input.z_mm + offset)};
}

// Direction to a light, and the factor that takes the geometry out of its irradiance.
struct Incoming {
  Vector3 l;
  V inverse_gain;  // 0 behind an LED
};

// kDividedFalloff: 1 / cosine by division, else by ReciprocalOf(), whose last bit differs.
template <bool kDividedFalloff>
HWY_INLINE Incoming IncomingFromNear(const KernelLamp& lamp, const Vector3& x_mm) {
  const D d;
  const V one = hn::Set(d, 1.0F);
  const Vector3 to_light{hn::Sub(hn::Set(d, lamp.place[0]), x_mm.x),
                         hn::Sub(hn::Set(d, lamp.place[1]), x_mm.y),
                         hn::Sub(hn::Set(d, lamp.place[2]), x_mm.z)};
  const V squared = Dot(to_light, to_light);
  const V inverse = ReciprocalRootOf(squared);
  Incoming in{
      {hn::Mul(to_light.x, inverse), hn::Mul(to_light.y, inverse), hn::Mul(to_light.z, inverse)},
      squared};
  if (IsLed(lamp.model)) {
    const Vector3 axis{hn::Set(d, lamp.axis[0]), hn::Set(d, lamp.axis[1]),
                       hn::Set(d, lamp.axis[2])};
    const V cosine = hn::Neg(Dot(in.l, axis));
    const M before = hn::Gt(cosine, hn::Zero(d));
    const V safe = hn::IfThenElse(before, cosine, one);
    const V falloff = lamp.anisotropy == 1.0F
                          ? (kDividedFalloff ? hn::Div(one, safe) : ReciprocalOf(safe))
                          : hn::Exp(d, hn::Mul(hn::Set(d, -lamp.anisotropy), hn::Log(d, safe)));
    in.inverse_gain = hn::IfThenElseZero(before, hn::Mul(squared, falloff));
  }
  return in;
}

// `inverse_gains`: 1 / g of a light with a field, at the vector's first pixel.
template <bool kDividedFalloff>
HWY_INLINE Incoming IncomingAt(const KernelLamp& lamp, const Vector3& x_mm,
                               const float* inverse_gains) {
  const D d;
  if (lamp.model == LightModel::kDistant) {
    return {{hn::Set(d, lamp.place[0]), hn::Set(d, lamp.place[1]), hn::Set(d, lamp.place[2])},
            hn::Set(d, 1.0F)};
  }
  Incoming in = IncomingFromNear<kDividedFalloff>(lamp, x_mm);
  if (lamp.model == LightModel::kLedField) {
    in.inverse_gain = hn::Mul(in.inverse_gain, hn::LoadU(d, inverse_gains));
  }
  return in;
}

// Returns where the gains of light k begin; null without a field.
template <typename Input>
HWY_INLINE const float* GainsOf(const Input& input, size_t k, size_t offset) {
  return input.inverse_gains == nullptr || input.inverse_gains[k] == nullptr
             ? nullptr
             : input.inverse_gains[k] + offset;
}

HWY_INLINE M AllFinite(V r, V g, V b) {
  const V zero = hn::Zero(D());
  return hn::Eq(hn::MulAdd(r, zero, hn::MulAdd(g, zero, hn::Mul(b, zero))), zero);
}

struct Gathered {
  V brightest;      // largest i'_k of the unsaturated samples
  V dimmest;        // smallest i'_k; -1 where a sample is saturated or not a number
  V brightest_raw;  // largest radiance of any finite sample
  V saturated;      // number of saturated samples
  M bright;         // some sample is above its dark level
};

// Fills the scratch. The luminance of samples that are saturated or not numbers is -1.
template <bool kDistant, bool kScaled>
HWY_INLINE Gathered Gather(const KernelParams& params, const KernelInput& input, size_t offset,
                           const Vector3& x_mm, const Scale& scale, float* HWY_RESTRICT scratch) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  const float* const* const planes = input.planes;
  Gathered gathered{zero, hn::Inf(d), zero, zero, NoLanes()};
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const KernelLight& light = params.lights[k];
    for (size_t c = 0; c < 3; ++c) {
      hwy::Prefetch(planes[3 * k + c] + offset + kPrefetchAhead);
    }
    V r = hn::LoadU(d, planes[3 * k] + offset);
    V g = hn::LoadU(d, planes[3 * k + 1] + offset);
    V b = hn::LoadU(d, planes[3 * k + 2] + offset);
    const M number = AllFinite(r, g, b);
    V peak = hn::Max(hn::Max(r, g), b);
    const M clipped = hn::Ge(peak, hn::Set(d, light.clip));
    V dark = hn::Set(d, light.dark);
    if constexpr (kScaled) {
      r = ScaleUp(r, scale);
      g = ScaleUp(g, scale);
      b = ScaleUp(b, scale);
      peak = hn::Max(hn::Max(r, g), b);
      dark = hn::Mul(dark, scale.forward);
    }
    r = hn::Mul(r, hn::Set(d, light.inverse_flux[0]));
    g = hn::Mul(g, hn::Set(d, light.inverse_flux[1]));
    b = hn::Mul(b, hn::Set(d, light.inverse_flux[2]));
    float* HWY_RESTRICT slot = scratch + k * kScratchPerLight * lanes;
    if constexpr (!kDistant) {
      const Incoming in = IncomingAt<true>(light.lamp, x_mm, GainsOf(input, k, offset));
      r = hn::Mul(r, in.inverse_gain);
      g = hn::Mul(g, in.inverse_gain);
      b = hn::Mul(b, in.inverse_gain);
      hn::Store(in.l.x, d, slot);
      hn::Store(in.l.y, d, slot + lanes);
      hn::Store(in.l.z, d, slot + 2 * lanes);
      hn::Store(in.inverse_gain, d, slot + 7 * lanes);
    }
    const V luminance = hn::MulAdd(
        hn::Set(d, kLuminance[0]), r,
        hn::MulAdd(hn::Set(d, kLuminance[1]), g, hn::Mul(hn::Set(d, kLuminance[2]), b)));  // (2)
    const M usable = hn::AndNot(clipped, number);
    const M saturated = hn::And(clipped, number);
    const V kept = hn::IfThenElse(usable, luminance, hn::Set(d, -1.0F));
    const V known_peak = hn::IfThenElseZero(number, peak);
    gathered.brightest = hn::Max(gathered.brightest, kept);
    gathered.dimmest = hn::Min(gathered.dimmest, kept);
    gathered.brightest_raw = hn::Max(gathered.brightest_raw, known_peak);
    gathered.saturated =
        hn::Add(gathered.saturated, hn::IfThenElseZero(saturated, hn::Set(d, 1.0F)));
    gathered.bright = hn::Or(gathered.bright, hn::Gt(known_peak, dark));
    hn::Store(r, d, slot + 3 * lanes);
    hn::Store(g, d, slot + 4 * lanes);
    hn::Store(b, d, slot + 5 * lanes);
    hn::Store(kept, d, slot + 6 * lanes);
  }
  return gathered;
}

// Returns the bits of the brightest channel of any finite sample, also where that is subnormal.
HWY_INLINE VI BrightestBits(const KernelParams& params, const float* const* planes, size_t offset) {
  const D d;
  const DI di;
  VI brightest = hn::Zero(di);
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const V r = hn::LoadU(d, planes[3 * k] + offset);
    const V g = hn::LoadU(d, planes[3 * k + 1] + offset);
    const V b = hn::LoadU(d, planes[3 * k + 2] + offset);
    const VI peak = hn::Max(hn::Max(hn::BitCast(di, r), hn::BitCast(di, g)), hn::BitCast(di, b));
    const auto number = hn::RebindMask(di, AllFinite(r, g, b));
    brightest = hn::Max(brightest, hn::IfThenElseZero(number, peak));
  }
  return brightest;
}

// State of one thread from vector to vector.
struct State {
  hwy::AlignedFreeUniquePtr<float[]> scratch;
  // Guess that the next vector is as far from 1 as the last. It saves a pass; the bits do not
  // depend on it.
  bool expect_far_from_one = false;
};

// Gathers; chooses `scale` so that no pixel overflows or underflows.
template <bool kDistant>
HWY_INLINE Gathered GatherScaled(const KernelParams& params, const KernelInput& input,
                                 size_t offset, const Vector3& x_mm, Scale& scale, State& state) {
  const D d;
  const DI di;
  float* scratch = state.scratch.get();
  Gathered gathered;
  if (HWY_LIKELY(!state.expect_far_from_one)) {
    gathered = Gather<kDistant, false>(params, input, offset, x_mm, scale, scratch);
    const V raw = gathered.brightest_raw;
    const M near_one =
        hn::And(hn::Ge(raw, hn::Set(d, kTwoToMinus40)), hn::Le(raw, hn::Set(d, kTwoTo40)));
    if (HWY_LIKELY(hn::AllTrue(d, near_one))) {
      return gathered;
    }
  }
  const VI brightest_bits = BrightestBits(params, input.planes, offset);
  const VI two_to_40 = hn::BitCast(di, hn::Set(d, kTwoTo40));
  const VI two_to_minus_40 = hn::BitCast(di, hn::Set(d, kTwoToMinus40));
  const auto small =
      hn::And(hn::Gt(brightest_bits, hn::Zero(di)), hn::Lt(brightest_bits, two_to_minus_40));
  const bool far = !hn::AllFalse(di, hn::Or(small, hn::Gt(brightest_bits, two_to_40)));
  if (far) {
    scale = ScaleFor(brightest_bits);
  }
  if (far || state.expect_far_from_one) {
    gathered = Gather<kDistant, true>(params, input, offset, x_mm, scale, scratch);
  }
  state.expect_far_from_one = far;
  return gathered;
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
