// Noise weights for solver/fast_kernel.cc: equations (1) to (5) of solver/ladder.h. Compiled once for
// each instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_FAST_KERNEL_WEIGHTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_FAST_KERNEL_WEIGHTS_INL_H_
#undef SATEEN_SOLVER_FAST_KERNEL_WEIGHTS_INL_H_
#else
#define SATEEN_SOLVER_FAST_KERNEL_WEIGHTS_INL_H_
#endif

#include <hwy/highway.h>

#include <numbers>

#include "solver/fast_kernel.h"
#include "solver/fast_kernel_equations-inl.h"
#include "solver/fast_kernel_gather-inl.h"
#include "solver/fast_kernel_vectors-inl.h"
#include "solver/noise.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {

constexpr float kDegreesPerRadian = static_cast<float>(180.0 / std::numbers::pi);
// Weights spread the condition number of A; float holds that much more of it.
constexpr float kWeightedConditionFactor = 16.0F;

struct Weighted {
  Vector3 n;
  V uncertainty_deg;
  V misfit;
  V sum_of_squares;  // of the luminance's residuals, as ResidualOf has it
  M accepted;
};

// Variance of N / |N| across N, as an angle: (tr C - n C n) / |N|^2.
HWY_INLINE V AngularVariance(const Symmetric3& c, const Vector3& n) {
  const D d;
  const V squared = hn::Max(Dot(n, n), hn::Set(d, 1e-37F));
  const V along = hn::Div(Dot(n, Times(c, n)), squared);
  const V trace = hn::Add(c.xx, hn::Add(c.yy, c.zz));
  return hn::Div(hn::Max(hn::Sub(trace, along), hn::Zero(d)), squared);
}

HWY_INLINE void AddOuter(const Vector3& l, V weight, Symmetric3& sum) {
  const V wx = hn::Mul(weight, l.x);
  const V wy = hn::Mul(weight, l.y);
  sum.xx = hn::MulAdd(wx, l.x, sum.xx);
  sum.xy = hn::MulAdd(wx, l.y, sum.xy);
  sum.xz = hn::MulAdd(wx, l.z, sum.xz);
  sum.yy = hn::MulAdd(wy, l.y, sum.yy);
  sum.yz = hn::MulAdd(wy, l.z, sum.yz);
  sum.zz = hn::MulAdd(hn::Mul(weight, l.z), l.z, sum.zz);
}

// What the variance of channel c is made of, in units of that of a white pixel facing light 0, so
// that float holds the weights whatever the units.
struct NoiseUnit {
  V shot;  // times the lane's power of two
  V read;  // its square
};

HWY_INLINE NoiseUnit NoiseUnitOf(const Scale& scale) {
  const D d;
  // The square must not overflow; at such radiance nothing but read noise is left.
  const V forward = hn::Min(scale.forward, hn::Set(d, 0x1p60F));
  return {forward, hn::Mul(forward, forward)};
}

template <bool kDistant>
HWY_INLINE Weighted WeightedStep(const KernelParams& params, const float* scratch, V threshold,
                                 const Vector3* n_rgb, const Vector3& n, V count,
                                 const Scale& scale) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  const V one = hn::Set(d, 1.0F);
  const V tiny = hn::Set(d, 1e-37F);
  const V squared = hn::Max(Dot(n, n), tiny);
  const V length = hn::Sqrt(squared);
  const V least = hn::Mul(length, hn::Set(d, kLeastCosine));
  const NoiseUnit unit = NoiseUnitOf(scale);
  V b[3];
  for (size_t c = 0; c < 3; ++c) {
    b[c] = hn::Max(hn::Div(Dot(n_rgb[c], n), squared), zero);  // (2)
  }
  V reference = one;
  V inverse_reference = one;
  Symmetric3 a{zero, zero, zero, zero, zero, zero};
  Vector3 gradient{zero, zero, zero};
  V chi_squared = zero;
  V sum_of_squares = zero;
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const KernelLight& light = params.lights[k];
    const float* slot = scratch + k * kScratchPerLight * lanes;
    const V luminance = hn::Load(d, slot + 6 * lanes);
    const M usable = hn::Gt(luminance, threshold);
    const Vector3 l = DirectionOf<kDistant>(light, slot, usable);
    const V predicted = Dot(l, n);
    const V left = hn::Sub(hn::IfThenElseZero(usable, luminance), predicted);
    sum_of_squares = hn::MulAdd(left, left, sum_of_squares);
    const V bright = hn::Max(predicted, least);
    V gain = one;
    if constexpr (!kDistant) {
      gain = hn::Load(d, slot + 7 * lanes);
    }
    const auto variance = [&](size_t c, V signal) HWY_ATTR {  // (1), of i'
      const V factor = hn::Mul(gain, hn::Set(d, light.inverse_flux[c]));
      return hn::Mul(
          factor,
          hn::MulAdd(hn::Mul(hn::Set(d, light.shot[c]), unit.shot), signal,
                     hn::Mul(factor, hn::Mul(hn::Set(d, light.read_squared[c]), unit.read))));
    };
    if (k == 0) {
      gain = hn::IfThenElse(hn::Gt(gain, zero), gain, hn::Set(d, 1e6F));  // behind the LED
      reference = hn::Max(variance(1, length), tiny);
      inverse_reference = hn::Div(one, reference);
    }
    // One division for three reciprocals; the bounds keep their product in a float.
    const auto relative = [&](size_t c) HWY_ATTR {
      return hn::Clamp(hn::Mul(variance(c, hn::Mul(b[c], bright)), inverse_reference),
                       hn::Set(d, 1e-9F), hn::Set(d, 1e9F));
    };
    const V v[3] = {relative(0), relative(1), relative(2)};
    const V v12 = hn::Mul(v[1], v[2]);
    const V inverse_all = hn::Div(one, hn::Mul(v[0], v12));
    const V share[3] = {hn::Mul(b[0], hn::Mul(v12, inverse_all)),
                        hn::Mul(b[1], hn::Mul(hn::Mul(v[0], v[2]), inverse_all)),
                        hn::Mul(b[2], hn::Mul(hn::Mul(v[0], v[1]), inverse_all))};
    V weight = hn::MulAdd(share[0], b[0], hn::MulAdd(share[1], b[1], hn::Mul(share[2], b[2])));
    const V weighted_sample =
        hn::MulAdd(share[0], hn::Load(d, slot + 3 * lanes),
                   hn::MulAdd(share[1], hn::Load(d, slot + 4 * lanes),
                              hn::Mul(share[2], hn::Load(d, slot + 5 * lanes))));
    weight = hn::IfThenElseZero(usable, weight);  // W of (4)
    const V r = hn::IfThenElseZero(usable, hn::NegMulAdd(weight, predicted, weighted_sample));
    AddOuter(l, weight, a);
    AddScaled(l, r, gradient);
    chi_squared = hn::Add(chi_squared, hn::Div(hn::Mul(r, r), hn::Max(weight, tiny)));
  }
  const Inverse inverse = Invert(a, params.max_condition_squared * kWeightedConditionFactor);
  const Vector3 step = Times(inverse.a, gradient);
  Weighted weighted;
  weighted.n = {hn::Add(n.x, step.x), hn::Add(n.y, step.y), hn::Add(n.z, step.z)};
  chi_squared = hn::Max(hn::Sub(chi_squared, Dot(gradient, step)), zero);
  const V freedom = hn::Sub(count, hn::Set(d, 3.0F));
  weighted.misfit =
      hn::IfThenElseZero(hn::Gt(freedom, zero),
                         hn::Div(chi_squared, hn::Mul(reference, hn::Max(freedom, one))));  // (5)
  weighted.uncertainty_deg =
      hn::Mul(hn::Sqrt(hn::Mul(AngularVariance(inverse.a, weighted.n), reference)),
              hn::Set(d, kDegreesPerRadian));  // (4)
  weighted.sum_of_squares = sum_of_squares;
  weighted.accepted = inverse.accepted;
  return weighted;
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
