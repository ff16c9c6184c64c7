// Normal equations of a vector of pixels, for solver/kernels/fast_kernel.cc. Compiled once per
// instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_FAST_KERNEL_EQUATIONS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_FAST_KERNEL_EQUATIONS_INL_H_
#undef SATEEN_SOLVER_FAST_KERNEL_EQUATIONS_INL_H_
#else
#define SATEEN_SOLVER_FAST_KERNEL_EQUATIONS_INL_H_
#endif

#include <hwy/highway.h>

#include "imaging/color.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/kernels/fast_kernel_gather-inl.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/normal_field.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
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

// Returns v, or zero where the sample is not usable. kAllUsable: skips the test.
template <bool kAllUsable = false>
HWY_INLINE V KeptOf(M usable, V v) {
  if constexpr (kAllUsable) {
    return v;
  } else {
    return hn::IfThenElseZero(usable, v);
  }
}

template <bool kDistant, bool kAllUsable = false>
HWY_INLINE Vector3 DirectionOf(const KernelLight& light, const float* slot, M usable) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  if constexpr (kDistant) {
    return {KeptOf<kAllUsable>(usable, hn::Set(d, light.lamp.place[0])),
            KeptOf<kAllUsable>(usable, hn::Set(d, light.lamp.place[1])),
            KeptOf<kAllUsable>(usable, hn::Set(d, light.lamp.place[2]))};
  } else {
    return {KeptOf<kAllUsable>(usable, hn::Load(d, slot)),
            KeptOf<kAllUsable>(usable, hn::Load(d, slot + lanes)),
            KeptOf<kAllUsable>(usable, hn::Load(d, slot + 2 * lanes))};
  }
}

HWY_INLINE void AddSquare(const Vector3& l, Symmetric3& sum) {
  sum.xx = hn::MulAdd(l.x, l.x, sum.xx);
  sum.xy = hn::MulAdd(l.x, l.y, sum.xy);
  sum.xz = hn::MulAdd(l.x, l.z, sum.xz);
  sum.yy = hn::MulAdd(l.y, l.y, sum.yy);
  sum.yz = hn::MulAdd(l.y, l.z, sum.yz);
  sum.zz = hn::MulAdd(l.z, l.z, sum.zz);
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
    AddSquare(l, eq.a);
    AddScaled(l, hn::IfThenElseZero(usable, hn::Load(d, slot + 3 * lanes)), eq.b[0]);
    AddScaled(l, hn::IfThenElseZero(usable, hn::Load(d, slot + 4 * lanes)), eq.b[1]);
    AddScaled(l, hn::IfThenElseZero(usable, hn::Load(d, slot + 5 * lanes)), eq.b[2]);
    eq.count = hn::Add(eq.count, hn::IfThenElseZero(usable, hn::Set(d, 1.0F)));
  }
  return eq;
}

struct Inverse {
  Symmetric3 a;
  M accepted;           // within the bound on the condition number
  Symmetric3 cofactor;  // a times det; det counts as 1 where it is not accepted
  V inverse_det;
};

HWY_INLINE Vector3 Scaled(const Vector3& v, V factor) {
  return {hn::Mul(v.x, factor), hn::Mul(v.y, factor), hn::Mul(v.z, factor)};
}

HWY_INLINE Symmetric3 Scaled(const Symmetric3& a, V factor) {
  return {hn::Mul(a.xx, factor), hn::Mul(a.xy, factor), hn::Mul(a.xz, factor),
          hn::Mul(a.yy, factor), hn::Mul(a.yz, factor), hn::Mul(a.zz, factor)};
}

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
  const V inverse = ReciprocalOf(hn::IfThenElse(accepted, det, hn::Set(d, 1.0F)));
  return {Scaled(cofactor, inverse), accepted, cofactor, inverse};
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

HWY_INLINE VI ReasonOf(V saturated, M bright, M enough, M accepted) {
  const DI di;
  const auto code = [&](Reason reason) { return hn::Set(di, static_cast<int32_t>(reason)); };
  const auto bits = [&](M mask) { return hn::RebindMask(di, mask); };
  const M some_saturated = hn::Gt(saturated, hn::Zero(D()));
  const VI too_few =
      hn::IfThenElse(bits(some_saturated), code(Reason::kSaturated), code(Reason::kTooFewSamples));
  const VI answered =
      hn::IfThenElse(bits(accepted), code(Reason::kSolved), code(Reason::kIllConditioned));
  return hn::IfThenElse(bits(bright), hn::IfThenElse(bits(enough), answered, too_few),
                        code(Reason::kDark));
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

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
