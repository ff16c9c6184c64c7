// Noise weights for solver/kernels/fast_kernel.cc: equations (1) to (5) of
// solver/least_squares/weighted.h. Compiled once per instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_FAST_KERNEL_WEIGHTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_FAST_KERNEL_WEIGHTS_INL_H_
#undef SATEEN_SOLVER_FAST_KERNEL_WEIGHTS_INL_H_
#else
#define SATEEN_SOLVER_FAST_KERNEL_WEIGHTS_INL_H_
#endif

#include <hwy/highway.h>

#include <numbers>

#include "solver/kernels/fast_kernel.h"
#include "solver/kernels/fast_kernel_equations-inl.h"
#include "solver/kernels/fast_kernel_gather-inl.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/noise.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {

constexpr float kDegreesPerRadian = static_cast<float>(180.0 / std::numbers::pi);
// Weights spread the condition number of A; float holds that much more of it.
constexpr float kWeightedConditionFactor = 16.0F;

// Smallest share of a channel in the variance, for channels without noise.
constexpr float kLeastVarianceShare = 1e-6F;
// Smallest variance of a sample relative to `reference`.
constexpr float kLeastVariance = 1e-9F;

struct Weighted {
  Vector3 n;
  V colour[3];  // b_c of (2)
  V uncertainty_deg;
  V albedo_uncertainty;
  V misfit;
  V sum_of_squares;  // of the luminance's residuals, as ResidualOf has it
  V count;
  M accepted;
};

// Sums that the weighted step starts from.
struct StartEquations {
  Symmetric3 a;  // sum of l l^T
  Vector3 b;     // sum of l i'
  V sum[3];      // of i'_c
  V count;
};

template <bool kDistant, bool kAllUsable>
HWY_INLINE StartEquations AccumulateStart(const KernelParams& params, const float* scratch,
                                          V threshold) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  StartEquations eq{
      {zero, zero, zero, zero, zero, zero}, {zero, zero, zero}, {zero, zero, zero}, zero};
  if constexpr (kAllUsable) {
    eq.count = hn::Set(d, static_cast<float>(params.lights.size()));
  }
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const float* slot = scratch + k * kScratchPerLight * lanes;
    const V luminance = hn::Load(d, slot + 6 * lanes);
    const M usable = hn::Gt(luminance, threshold);
    const Vector3 l = DirectionOf<kDistant, kAllUsable>(params.lights[k], slot, usable);
    AddSquare(l, eq.a);
    AddScaled(l, KeptOf<kAllUsable>(usable, luminance), eq.b);
    for (size_t c = 0; c < 3; ++c) {
      eq.sum[c] =
          hn::Add(eq.sum[c], KeptOf<kAllUsable>(usable, hn::Load(d, slot + (3 + c) * lanes)));
    }
    if constexpr (!kAllUsable) {
      eq.count = hn::Add(eq.count, hn::IfThenElseZero(usable, hn::Set(d, 1.0F)));
    }
  }
  return eq;
}

// Variances of a solution, NormalVariances in vectors.
struct Variances {
  V angular;  // of N / |N|, in radians squared: (tr C - n C n) / |N|^2
  V albedo;   // of |N|, relative: n C n / |N|^2
};

HWY_INLINE Variances VariancesOf(const Symmetric3& c, const Vector3& n) {
  const D d;
  const V inverse = RoughReciprocalOf(hn::Max(Dot(n, n), hn::Set(d, 1e-37F)));
  const V trace = hn::Add(c.xx, hn::Add(c.yy, c.zz));
  const V along = hn::Mul(Dot(n, Times(c, n)), inverse);
  const V across = hn::Sub(trace, along);
  return {hn::Mul(hn::Max(across, hn::Zero(d)), inverse),
          hn::Mul(hn::Max(along, hn::Zero(d)), inverse)};
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

// Common terms of the noise weights of a vector of pixels. With g_k the factor of light k that
// depends on the place,
//
//     sum_c u_c^2 var_kc = reference g_k (max(N . l_k, ..) shot_k . D + g_k read_k . E)
//
// where `reference` is the power of two below the sum of the channels' variances on a pixel that
// faces light 0: float holds the rest in any units.
struct NoiseUnits {
  V u[3];  // (3)
  V d[3];
  V e[3];
  V least;  // 0.02 |N|
  V reference;
  V of_luminance;  // R of (4)
};

// Computes them from the variances of (1) on a pixel that faces light 0.
template <bool kDistant>
HWY_INLINE NoiseUnits NoiseUnitsOf(const KernelLight& light, const float* slot, const V* b,
                                   const Vector3& n, const Scale& scale) {
  const D d;
  const V zero = hn::Zero(d);
  const V tiny = hn::Set(d, 1e-37F);
  const V length = RootOf(Dot(n, n));
  // The square must not overflow; at such radiance nothing but read noise is left.
  const V forward = hn::Min(scale.forward, hn::Set(d, 0x1p60F));
  V gain = hn::Set(d, 1.0F);
  if constexpr (!kDistant) {
    gain = hn::Load(d, slot + 7 * hn::Lanes(d));
    gain = hn::IfThenElse(hn::Gt(gain, zero), gain, hn::Set(d, 1e6F));  // behind the LED
  }
  const V read = hn::Mul(forward, forward);
  const V shot = hn::Mul(forward, length);
  V variance[3];
  for (size_t c = 0; c < 3; ++c) {
    variance[c] = hn::MulAdd(b[c], hn::Mul(shot, hn::Set(d, light.shot[c])),
                             hn::Mul(hn::Mul(gain, hn::Set(d, light.read_squared[c])), read));
  }
  const V sum = hn::Add(variance[0], hn::Add(variance[1], variance[2]));
  const V least = hn::MulAdd(sum, hn::Set(d, kLeastVarianceShare), tiny);
  V t[3];
  for (size_t c = 0; c < 3; ++c) {
    t[c] = hn::Mul(b[c], RoughReciprocalOf(hn::Max(variance[c], least)));
  }
  const V norm = hn::MulAdd(t[0], b[0], hn::MulAdd(t[1], b[1], hn::Mul(t[2], b[2])));
  const V inverse_norm = ReciprocalOf(hn::Max(norm, tiny));
  NoiseUnits units;
  units.reference = PowerOfTwoBelow(hn::Max(hn::Mul(gain, sum), tiny));
  const V inverse = ReciprocalOfPower(units.reference);
  for (size_t c = 0; c < 3; ++c) {
    units.u[c] = hn::Mul(t[c], inverse_norm);
    const V squared_u = hn::Mul(units.u[c], units.u[c]);
    units.d[c] = hn::Mul(squared_u, hn::Mul(inverse, hn::Mul(b[c], forward)));
    units.e[c] = hn::Mul(squared_u, hn::Mul(inverse, read));
  }
  units.least = hn::Mul(length, hn::Set(d, kLeastCosine));
  V of_luminance = zero;
  V of_m = tiny;
  for (size_t c = 0; c < 3; ++c) {
    const V bounded = hn::Max(variance[c], least);
    of_luminance = hn::MulAdd(hn::Set(d, kLuminance[c] * kLuminance[c]), bounded, of_luminance);
    of_m = hn::MulAdd(hn::Mul(units.u[c], units.u[c]), bounded, of_m);
  }
  units.of_luminance = hn::Mul(of_luminance, RoughReciprocalOf(of_m));
  return units;
}

// Returns the dot product of three constants of a light and three of a pixel.
HWY_INLINE V DotOf(const std::array<float, 3>& of_light, const V* of_pixel) {
  const D d;
  return hn::MulAdd(hn::Set(d, of_light[0]), of_pixel[0],
                    hn::MulAdd(hn::Set(d, of_light[1]), of_pixel[1],
                               hn::Mul(hn::Set(d, of_light[2]), of_pixel[2])));
}

// Stores N . l_k, zero where the sample is not usable. Returns the sum of squares of the
// luminance's residuals. It is a loop of its own because it does not wait for NoiseUnits: in one
// loop with the weights, few lights fit into the processor's window, and the kernel took 22.4
// instead of 20.7 ns per pixel in the cache.
template <bool kDistant, bool kAllUsable>
HWY_INLINE V PredictSamples(const KernelParams& params, float* scratch, V threshold,
                            const Vector3& n) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  V sum_of_squares = hn::Zero(d);
  for (size_t k = 0; k < params.lights.size(); ++k) {
    float* slot = scratch + k * kScratchPerLight * lanes;
    const V luminance = hn::Load(d, slot + 6 * lanes);
    const M usable = hn::Gt(luminance, threshold);
    const V predicted = Dot(DirectionOf<kDistant, kAllUsable>(params.lights[k], slot, usable), n);
    const V left = hn::Sub(KeptOf<kAllUsable>(usable, luminance), predicted);
    sum_of_squares = hn::MulAdd(left, left, sum_of_squares);
    hn::Store(predicted, d, slot + 8 * lanes);
  }
  return sum_of_squares;
}

// Stores m_k - N . l_k and W_k, which is in units of 1 / `reference` and zero where the sample is
// not usable.
template <bool kDistant, bool kAllUsable>
HWY_INLINE void WeighSamples(const KernelParams& params, float* scratch, V threshold,
                             const NoiseUnits& units) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const KernelLight& light = params.lights[k];
    float* slot = scratch + k * kScratchPerLight * lanes;
    const M usable = hn::Gt(hn::Load(d, slot + 6 * lanes), threshold);
    const V predicted = hn::Load(d, slot + 8 * lanes);
    const V mean = hn::MulAdd(units.u[0], hn::Load(d, slot + 3 * lanes),
                              hn::MulAdd(units.u[1], hn::Load(d, slot + 4 * lanes),
                                         hn::Mul(units.u[2], hn::Load(d, slot + 5 * lanes))));
    const V bright = hn::Max(predicted, units.least);
    const V shot = hn::Mul(bright, DotOf(light.shot, units.d));
    const V read = DotOf(light.read_squared, units.e);
    V variance;
    if constexpr (kDistant) {
      variance = hn::Add(shot, read);
    } else {
      const V gain = hn::Load(d, slot + 7 * lanes);
      variance = hn::Mul(gain, hn::MulAdd(gain, read, shot));
    }
    const V weight = RoughReciprocalOf(hn::Max(variance, hn::Set(d, kLeastVariance)));
    hn::Store(KeptOf<kAllUsable>(usable, weight), d, slot + 3 * lanes);
    hn::Store(KeptOf<kAllUsable>(usable, hn::Sub(mean, predicted)), d, slot + 4 * lanes);
  }
}

// Sums of (4) and (5).
struct WeightedSums {
  Symmetric3 a;      // sum of W l l^T
  Vector3 gradient;  // sum of W l misfit
  V chi_squared;
};

template <bool kDistant>
HWY_INLINE WeightedSums AccumulateWeighted(const KernelParams& params, const float* scratch) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  WeightedSums sums{{zero, zero, zero, zero, zero, zero}, {zero, zero, zero}, zero};
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const float* slot = scratch + k * kScratchPerLight * lanes;
    const Vector3 l = DirectionOf<kDistant, true>(params.lights[k], slot, NoLanes());
    const V weight = hn::Load(d, slot + 3 * lanes);
    const V misfit = hn::Load(d, slot + 4 * lanes);
    const V r = hn::Mul(weight, misfit);
    AddOuter(l, weight, sums.a);
    AddScaled(l, r, sums.gradient);
    sums.chi_squared = hn::MulAdd(r, misfit, sums.chi_squared);
  }
  return sums;
}

// kAllUsable: every sample of every lane is usable, as in most vectors of a cloth. Gives the same
// bits without the masks, which are a tenth of the work.
template <bool kDistant, bool kAllUsable>
HWY_INLINE Weighted SolveWeighted(const KernelParams& params, float* scratch, V threshold,
                                  const Scale& scale) {
  const D d;
  const V zero = hn::Zero(d);
  const StartEquations start = AccumulateStart<kDistant, kAllUsable>(params, scratch, threshold);
  Weighted weighted;
  const V luminance = hn::MulAdd(hn::Set(d, kLuminance[0]), start.sum[0],
                                 hn::MulAdd(hn::Set(d, kLuminance[1]), start.sum[1],
                                            hn::Mul(hn::Set(d, kLuminance[2]), start.sum[2])));
  const V inverse_luminance = ReciprocalOf(hn::Max(luminance, hn::Set(d, 1e-37F)));
  for (size_t c = 0; c < 3; ++c) {
    weighted.colour[c] = hn::Mul(hn::Max(start.sum[c], zero), inverse_luminance);  // (2)
  }
  const Inverse first = Invert(start.a, params.max_condition_squared);
  const Vector3 n = Scaled(Times(first.cofactor, start.b), first.inverse_det);
  const NoiseUnits units =
      NoiseUnitsOf<kDistant>(params.lights[0], scratch, weighted.colour, n, scale);
  weighted.sum_of_squares = PredictSamples<kDistant, kAllUsable>(params, scratch, threshold, n);
  WeighSamples<kDistant, kAllUsable>(params, scratch, threshold, units);
  const WeightedSums sums = AccumulateWeighted<kDistant>(params, scratch);
  const Inverse inverse = Invert(sums.a, params.max_condition_squared * kWeightedConditionFactor);
  const Vector3 step = Times(inverse.a, sums.gradient);
  weighted.n = {hn::Add(n.x, step.x), hn::Add(n.y, step.y), hn::Add(n.z, step.z)};
  const V chi_squared = hn::Max(hn::Sub(sums.chi_squared, Dot(sums.gradient, step)), zero);
  const V freedom = hn::Sub(start.count, hn::Set(d, 3.0F));
  weighted.misfit = hn::IfThenElseZero(
      hn::Gt(freedom, zero),
      hn::Mul(chi_squared, hn::Mul(ReciprocalOfPower(units.reference),
                                   RoughReciprocalOf(hn::Max(freedom, hn::Set(d, 1.0F))))));  // (5)
  const Variances variances = VariancesOf(inverse.a, weighted.n);                             // (4)
  weighted.uncertainty_deg = hn::Mul(RoughRootOf(hn::Mul(variances.angular, units.reference)),
                                     hn::Set(d, kDegreesPerRadian));
  const V known = hn::Max(Dot(weighted.n, Times(sums.a, weighted.n)), hn::Set(d, 1e-37F));
  const V of_albedo = hn::MulAdd(hn::Sub(units.of_luminance, hn::Set(d, 1.0F)),
                                 RoughReciprocalOf(known), variances.albedo);
  weighted.albedo_uncertainty = RoughRootOf(hn::Mul(of_albedo, units.reference));
  weighted.count = start.count;
  weighted.accepted = hn::And(first.accepted, inverse.accepted);
  return weighted;
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
