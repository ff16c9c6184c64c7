#include "solver/fast_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/fast_kernel.cc"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/aligned_allocator.h>
#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "imaging/color.h"
#include "solver/fast_kernel_spans-inl.h"
#include "solver/fast_kernel_vectors-inl.h"
#include "solver/lambertian.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
// Scratch vectors of one light: l (near lights only), i' red, green, blue, luminance.
constexpr size_t kScratchPerLight = 7;

// 3 K streams are more than the hardware prefetchers follow. Fetching three cache lines ahead took
// ten near lights on two cores from 11.5 to 8.1 ns/px (floor 5.9); two to four lines do as well.
constexpr size_t kPrefetchAhead = 48;

// ---- Pass 1: lights and samples ----------------------------------------------------------------

// l and the factor that divides the irradiance's geometry out, at table position (x, y, 0).
struct Incoming {
  Vector3 l;
  V inverse_gain;  // 0 behind an LED
};

HWY_INLINE Incoming IncomingAt(const KernelLight& light, V x_mm, V y_mm) {
  const D d;
  const Vector3 to_light{hn::Sub(hn::Set(d, light.place[0]), x_mm),
                         hn::Sub(hn::Set(d, light.place[1]), y_mm), hn::Set(d, light.place[2])};
  const V squared = Dot(to_light, to_light);
  const V inverse = hn::Div(hn::Set(d, 1.0F), hn::Sqrt(squared));
  Incoming in{
      {hn::Mul(to_light.x, inverse), hn::Mul(to_light.y, inverse), hn::Mul(to_light.z, inverse)},
      squared};
  if (IsLed(light.model)) {
    const Vector3 axis{hn::Set(d, light.axis[0]), hn::Set(d, light.axis[1]),
                       hn::Set(d, light.axis[2])};
    const V cosine = hn::Neg(Dot(in.l, axis));
    const M before = hn::Gt(cosine, hn::Zero(d));
    const V safe = hn::IfThenElse(before, cosine, hn::Set(d, 1.0F));
    const V falloff = light.anisotropy == 1.0F
                          ? hn::Div(hn::Set(d, 1.0F), safe)
                          : hn::Exp(d, hn::Mul(hn::Set(d, -light.anisotropy), hn::Log(d, safe)));
    in.inverse_gain = hn::IfThenElseZero(before, hn::Mul(squared, falloff));
  }
  return in;
}

HWY_INLINE M AllFinite(V r, V g, V b) {
  const V zero = hn::Zero(D());
  return hn::Eq(hn::MulAdd(r, zero, hn::MulAdd(g, zero, hn::Mul(b, zero))), zero);
}

struct Gathered {
  V brightest;      // largest i'_k of the unsaturated samples
  V brightest_raw;  // largest radiance of any finite sample
  V saturated;      // how many samples are saturated
  M bright;         // some sample is above its dark level
};

// Fills the scratch; luminance is -1 for samples that are saturated or not numbers.
template <bool kDistant, bool kScaled>
HWY_INLINE Gathered Gather(const KernelParams& params, const KernelInput& input, size_t offset,
                           V x_mm, V y_mm, const Scale& scale, float* HWY_RESTRICT scratch) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  const float* const* const planes = input.planes;
  Gathered gathered{zero, zero, zero, NoLanes()};
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
      Incoming in;
      if (light.model == LightModel::kDistant) {
        in = {{hn::Set(d, light.place[0]), hn::Set(d, light.place[1]), hn::Set(d, light.place[2])},
              hn::Set(d, 1.0F)};
      } else {
        in = IncomingAt(light, x_mm, y_mm);
        if (light.model == LightModel::kLedField) {
          in.inverse_gain = hn::Mul(in.inverse_gain, hn::LoadU(d, input.inverse_gains[k] + offset));
        }
      }
      r = hn::Mul(r, in.inverse_gain);
      g = hn::Mul(g, in.inverse_gain);
      b = hn::Mul(b, in.inverse_gain);
      hn::Store(in.l.x, d, slot);
      hn::Store(in.l.y, d, slot + lanes);
      hn::Store(in.l.z, d, slot + 2 * lanes);
    }
    const V luminance = hn::MulAdd(
        hn::Set(d, kLuminance[0]), r,
        hn::MulAdd(hn::Set(d, kLuminance[1]), g, hn::Mul(hn::Set(d, kLuminance[2]), b)));  // (2)
    const M usable = hn::AndNot(clipped, number);
    const M saturated = hn::And(clipped, number);
    const V kept = hn::IfThenElse(usable, luminance, hn::Set(d, -1.0F));
    const V known_peak = hn::IfThenElseZero(number, peak);
    gathered.brightest = hn::Max(gathered.brightest, kept);
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

// Bits of the brightest channel of any finite sample, also where that is subnormal.
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

// What one thread carries from vector to vector.
struct State {
  hwy::AlignedFreeUniquePtr<float[]> scratch;
  // The vector before was far from 1. Only a guess that saves a pass: the bits do not depend on it.
  bool expect_far_from_one = false;
};

// Gathers, with `scale` such that no pixel over- or underflows.
template <bool kDistant>
HWY_INLINE Gathered GatherScaled(const KernelParams& params, const KernelInput& input,
                                 size_t offset, V x_mm, V y_mm, Scale& scale, State& state) {
  const D d;
  const DI di;
  float* scratch = state.scratch.get();
  Gathered gathered;
  if (HWY_LIKELY(!state.expect_far_from_one)) {
    gathered = Gather<kDistant, false>(params, input, offset, x_mm, y_mm, scale, scratch);
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
    gathered = Gather<kDistant, true>(params, input, offset, x_mm, y_mm, scale, scratch);
  }
  state.expect_far_from_one = far;
  return gathered;
}

// ---- Pass 2: the normal equations --------------------------------------------------------------

struct Symmetric3 {
  V xx, xy, xz, yy, yz, zz;
};

HWY_INLINE Vector3 Times(const Symmetric3& a, const Vector3& v) {
  return {hn::MulAdd(a.xx, v.x, hn::MulAdd(a.xy, v.y, hn::Mul(a.xz, v.z))),
          hn::MulAdd(a.xy, v.x, hn::MulAdd(a.yy, v.y, hn::Mul(a.yz, v.z))),
          hn::MulAdd(a.xz, v.x, hn::MulAdd(a.yz, v.y, hn::Mul(a.zz, v.z)))};
}

HWY_INLINE void AddScaled(const Vector3& l, V factor, Vector3& sum) {
  sum.x = hn::MulAdd(l.x, factor, sum.x);
  sum.y = hn::MulAdd(l.y, factor, sum.y);
  sum.z = hn::MulAdd(l.z, factor, sum.z);
}

template <bool kDistant>
HWY_INLINE Vector3 DirectionOf(const KernelLight& light, const float* slot, M usable) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  if constexpr (kDistant) {
    return {hn::IfThenElseZero(usable, hn::Set(d, light.place[0])),
            hn::IfThenElseZero(usable, hn::Set(d, light.place[1])),
            hn::IfThenElseZero(usable, hn::Set(d, light.place[2]))};
  } else {
    return {hn::IfThenElseZero(usable, hn::Load(d, slot)),
            hn::IfThenElseZero(usable, hn::Load(d, slot + lanes)),
            hn::IfThenElseZero(usable, hn::Load(d, slot + 2 * lanes))};
  }
}

struct NormalEquations {
  Symmetric3 a;  // sum of l l^T
  Vector3 b[3];  // sum of l i'_c
  V count;
};

template <bool kDistant>
HWY_INLINE NormalEquations Accumulate(const KernelParams& params, const float* scratch,
                                      V threshold) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  const Vector3 zero3{zero, zero, zero};
  NormalEquations eq{{zero, zero, zero, zero, zero, zero}, {zero3, zero3, zero3}, zero};
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const float* slot = scratch + k * kScratchPerLight * lanes;
    const M usable = hn::Gt(hn::Load(d, slot + 6 * lanes), threshold);
    const Vector3 l = DirectionOf<kDistant>(params.lights[k], slot, usable);
    eq.a.xx = hn::MulAdd(l.x, l.x, eq.a.xx);
    eq.a.xy = hn::MulAdd(l.x, l.y, eq.a.xy);
    eq.a.xz = hn::MulAdd(l.x, l.z, eq.a.xz);
    eq.a.yy = hn::MulAdd(l.y, l.y, eq.a.yy);
    eq.a.yz = hn::MulAdd(l.y, l.z, eq.a.yz);
    eq.a.zz = hn::MulAdd(l.z, l.z, eq.a.zz);
    AddScaled(l, hn::IfThenElseZero(usable, hn::Load(d, slot + 3 * lanes)), eq.b[0]);
    AddScaled(l, hn::IfThenElseZero(usable, hn::Load(d, slot + 4 * lanes)), eq.b[1]);
    AddScaled(l, hn::IfThenElseZero(usable, hn::Load(d, slot + 5 * lanes)), eq.b[2]);
    eq.count = hn::Add(eq.count, hn::IfThenElseZero(usable, hn::Set(d, 1.0F)));
  }
  return eq;
}

struct Inverse {
  Symmetric3 a;
  M accepted;  // within the bound on the condition number
};

HWY_INLINE Inverse Invert(const Symmetric3& a, float max_condition_squared) {
  const D d;
  const Symmetric3 cofactor{
      hn::MulSub(a.yy, a.zz, hn::Mul(a.yz, a.yz)), hn::MulSub(a.xz, a.yz, hn::Mul(a.xy, a.zz)),
      hn::MulSub(a.xy, a.yz, hn::Mul(a.xz, a.yy)), hn::MulSub(a.xx, a.zz, hn::Mul(a.xz, a.xz)),
      hn::MulSub(a.xy, a.xz, hn::Mul(a.xx, a.yz)), hn::MulSub(a.xx, a.yy, hn::Mul(a.xy, a.xy))};
  const V det =
      hn::MulAdd(a.xx, cofactor.xx, hn::MulAdd(a.xy, cofactor.xy, hn::Mul(a.xz, cofactor.xz)));
  const V trace = hn::Add(a.xx, hn::Add(a.yy, a.zz));
  const V minors = hn::Add(cofactor.xx, hn::Add(cofactor.yy, cofactor.zz));
  const M accepted =
      hn::Gt(hn::Mul(det, hn::Set(d, max_condition_squared)), hn::Mul(trace, minors));
  const V inverse = hn::Div(hn::Set(d, 1.0F), hn::IfThenElse(accepted, det, hn::Set(d, 1.0F)));
  return {
      {hn::Mul(cofactor.xx, inverse), hn::Mul(cofactor.xy, inverse), hn::Mul(cofactor.xz, inverse),
       hn::Mul(cofactor.yy, inverse), hn::Mul(cofactor.yz, inverse), hn::Mul(cofactor.zz, inverse)},
      accepted};
}

// ---- Pass 3: residuals and refinement ----------------------------------------------------------

struct Residual {
  V sum_of_squares;
  Vector3 gradient;  // sum of l r
};

template <bool kDistant>
HWY_INLINE Residual ResidualOf(const KernelParams& params, const float* scratch, V threshold,
                               const Vector3& n) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  Residual residual{zero, {zero, zero, zero}};
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const float* slot = scratch + k * kScratchPerLight * lanes;
    const V luminance = hn::Load(d, slot + 6 * lanes);
    const M usable = hn::Gt(luminance, threshold);
    const Vector3 l = DirectionOf<kDistant>(params.lights[k], slot, usable);
    const V r = hn::Sub(hn::IfThenElseZero(usable, luminance), Dot(l, n));
    residual.sum_of_squares = hn::MulAdd(r, r, residual.sum_of_squares);
    AddScaled(l, r, residual.gradient);
  }
  return residual;
}

HWY_INLINE Vector3 LuminanceOf(const Vector3* n) {
  const D d;
  const V wr = hn::Set(d, kLuminance[0]);
  const V wg = hn::Set(d, kLuminance[1]);
  const V wb = hn::Set(d, kLuminance[2]);
  return {hn::MulAdd(wr, n[0].x, hn::MulAdd(wg, n[1].x, hn::Mul(wb, n[2].x))),
          hn::MulAdd(wr, n[0].y, hn::MulAdd(wg, n[1].y, hn::Mul(wb, n[2].y))),
          hn::MulAdd(wr, n[0].z, hn::MulAdd(wg, n[1].z, hn::Mul(wb, n[2].z)))};
}

// ---- One vector of pixels ----------------------------------------------------------------------

HWY_INLINE VI ReasonOf(const Gathered& gathered, M enough, M accepted) {
  const D d;
  const DI di;
  const auto code = [&](Reason reason) { return hn::Set(di, static_cast<int32_t>(reason)); };
  const auto bits = [&](M mask) { return hn::RebindMask(di, mask); };
  const M some_saturated = hn::Gt(gathered.saturated, hn::Zero(d));
  const VI short_of_samples =
      hn::IfThenElse(bits(some_saturated), code(Reason::kSaturated), code(Reason::kTooFewSamples));
  const VI with_samples =
      hn::IfThenElse(bits(accepted), code(Reason::kSolved), code(Reason::kIllConditioned));
  const VI bright = hn::IfThenElse(bits(enough), with_samples, short_of_samples);
  return hn::IfThenElse(bits(gathered.bright), bright, code(Reason::kDark));
}

template <bool kDistant>
HWY_INLINE void SolveVector(const KernelParams& params, const KernelInput& input, size_t offset,
                            const KernelOutput& output, State& state) {
  const D d;
  const DI di;
  const V one = hn::Set(d, 1.0F);
  M inside = hn::Not(NoLanes());
  if (input.mask != nullptr) {
    const hn::Rebind<uint8_t, D> du8;
    const VI mask = hn::PromoteTo(di, hn::LoadU(du8, input.mask + offset));
    inside = hn::RebindMask(d, hn::Ne(mask, hn::Zero(di)));
  }
  if (hn::AllFalse(d, inside)) {
    StoreUnsolved(offset, output);
    return;
  }
  const V x_mm = kDistant ? hn::Zero(d) : hn::LoadU(d, input.x_mm + offset);
  const V y_mm = kDistant ? hn::Zero(d) : hn::LoadU(d, input.y_mm + offset);
  Scale scale{one, one, NoLanes()};
  const Gathered gathered = GatherScaled<kDistant>(params, input, offset, x_mm, y_mm, scale, state);
  const float* scratch = state.scratch.get();
  const V threshold = hn::Mul(gathered.brightest, hn::Set(d, params.shadow_level));
  const NormalEquations eq = Accumulate<kDistant>(params, scratch, threshold);
  const Inverse inverse = Invert(eq.a, params.max_condition_squared);
  const Vector3 n_rgb[3] = {Times(inverse.a, eq.b[0]), Times(inverse.a, eq.b[1]),
                            Times(inverse.a, eq.b[2])};  // (3)
  Vector3 n = LuminanceOf(n_rgb);
  const Residual residual = ResidualOf<kDistant>(params, scratch, threshold, n);
  const Vector3 step = Times(inverse.a, residual.gradient);
  n = {hn::Add(n.x, step.x), hn::Add(n.y, step.y), hn::Add(n.z, step.z)};

  const V squared = Dot(n, n);
  const M enough = hn::Ge(eq.count, hn::Set(d, 3.0F));
  const M finite = hn::And(hn::Gt(squared, hn::Zero(d)), hn::Lt(squared, hn::Set(d, 1e38F)));
  const M accepted = hn::And(inverse.accepted, finite);
  const M solved = hn::And(hn::And(inside, gathered.bright), hn::And(enough, accepted));
  const V inverse_length = hn::Div(one, hn::Sqrt(hn::IfThenElse(solved, squared, one)));  // (4)
  const V result_scale = hn::Set(d, params.result_scale);
  const auto store = [&](V value, float* to) {
    hn::StoreU(hn::IfThenElseZero(solved, value), d, to + offset);
  };
  store(hn::Mul(n.x, inverse_length), output.normal[0]);
  store(hn::Mul(n.y, inverse_length), output.normal[1]);
  store(hn::Mul(n.z, inverse_length), output.normal[2]);
  for (size_t c = 0; c < 3; ++c) {
    store(ScaleDown(hn::Mul(hn::Sqrt(Dot(n_rgb[c], n_rgb[c])), result_scale), scale),
          output.albedo[c]);
  }
  const V mean = hn::Div(residual.sum_of_squares, hn::Max(eq.count, one));
  store(ScaleDown(hn::Mul(hn::Sqrt(mean), result_scale), scale), output.residual);
  const auto inside_bits = hn::RebindMask(di, inside);
  StoreBytes(
      hn::IfThenElseZero(inside_bits, hn::Min(hn::ConvertTo(di, eq.count), hn::Set(di, 255))),
      output.samples + offset);
  StoreBytes(hn::IfThenElseZero(inside_bits, ReasonOf(gathered, enough, accepted)),
             output.reason + offset);
}

void SolveSpanImpl(const KernelParams& params, const KernelInput& input,
                   const KernelOutput& output) {
  const FlushSubnormals flush;
  State state{
      hwy::AllocateAligned<float>(params.lights.size() * kScratchPerLight * hn::Lanes(D()))};
  if (input.x_mm == nullptr) {
    ForEachVector(params, input, output,
                  [&](const KernelInput& in, size_t offset, const KernelOutput& out)
                      HWY_ATTR { SolveVector<true>(params, in, offset, out, state); });
  } else {
    ForEachVector(params, input, output,
                  [&](const KernelInput& in, size_t offset, const KernelOutput& out)
                      HWY_ATTR { SolveVector<false>(params, in, offset, out, state); });
  }
}

void TouchSpanImpl(const KernelParams& params, const KernelInput& input,
                   const KernelOutput& output) {
  ForEachVector(params, input, output,
                [&](const KernelInput& in, size_t offset, const KernelOutput& out)
                    HWY_ATTR { TouchVector(params, in, offset, out); });
}

std::string_view InstructionSetImpl() { return hwy::TargetName(HWY_TARGET); }

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sateen {

HWY_EXPORT(SolveSpanImpl);
HWY_EXPORT(TouchSpanImpl);
HWY_EXPORT(InstructionSetImpl);

void SolveSpan(const KernelParams& params, const KernelInput& input, const KernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(SolveSpanImpl)(params, input, output);
}

void TouchSpan(const KernelParams& params, const KernelInput& input, const KernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(TouchSpanImpl)(params, input, output);
}

std::string_view KernelInstructionSet() { return HWY_DYNAMIC_DISPATCH(InstructionSetImpl)(); }

}  // namespace sateen
#endif  // HWY_ONCE
