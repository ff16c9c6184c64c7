#include "solver/kernels/mosaic_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/kernels/mosaic_kernel.cc"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/highway.h>

#include "core/check.h"
#include "solver/kernels/fast_kernel_equations-inl.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/kernels/fast_kernel_weights-inl.h"
#include "solver/kernels/mosaic_albedo-inl.h"
#include "solver/kernels/mosaic_gather-inl.h"
#include "solver/lambertian.h"
#include "solver/noise.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
namespace {

struct SiteAnswer {
  Vector3 n;  // N
  V sum_of_squares;
  V count;
  V misfit;
  V uncertainty_deg;
  V albedo_uncertainty;
  M accepted;
};

// Solves (3) of solver/lambertian.h for one channel. ResidualStep() refines n.
HWY_INLINE SiteAnswer PlainLeastSquares(const MosaicKernelParams& params, const float* scratch,
                                        V threshold, Inverse& inverse) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  Symmetric3 a{zero, zero, zero, zero, zero, zero};
  Vector3 b{zero, zero, zero};
  V count = zero;
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const Usable u = UsableOf(scratch + k * kMosaicScratch * lanes, threshold);
    AddSquare(u.l, a);
    AddScaled(u.l, u.i, b);
    count = hn::Add(count, hn::IfThenElseZero(u.is, hn::Set(d, 1.0F)));
  }
  inverse = Invert(a, params.max_condition_squared);
  return {Times(inverse.a, b), zero, count, zero, zero, zero, inverse.accepted};
}

// Refines n by one step from the residuals of (3).
HWY_INLINE void ResidualStep(const MosaicKernelParams& params, const float* scratch, V threshold,
                             const Inverse& inverse, SiteAnswer& answer) {
  const size_t lanes = hn::Lanes(D());
  Vector3 gradient{hn::Zero(D()), hn::Zero(D()), hn::Zero(D())};
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const Usable u = UsableOf(scratch + k * kMosaicScratch * lanes, threshold);
    const V r = hn::Sub(u.i, Dot(u.l, answer.n));
    answer.sum_of_squares = hn::MulAdd(r, r, answer.sum_of_squares);
    AddScaled(u.l, r, gradient);
  }
  const Vector3 step = Times(inverse.a, gradient);
  answer.n = {hn::Add(answer.n.x, step.x), hn::Add(answer.n.y, step.y),
              hn::Add(answer.n.z, step.z)};
}

// Solves (2) and (3) of solver/mosaic/mosaic.h.
HWY_INLINE void WeightedSiteStep(const MosaicKernelParams& params, const RowState& state,
                                 size_t offset, V threshold, SiteAnswer& answer) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  const V length = hn::Sqrt(hn::Max(Dot(answer.n, answer.n), hn::Set(d, 1e-37F)));
  const V least = hn::Mul(length, hn::Set(d, kLeastCosine));
  Symmetric3 a{zero, zero, zero, zero, zero, zero};
  Vector3 gradient{zero, zero, zero};
  V chi_squared = zero;
  for (size_t k = 0; k < params.lights.size(); ++k) {
    const float* figures = state.FiguresOf(k, params.lights.size(), offset);
    const float* slot = state.scratch.get() + k * kMosaicScratch * lanes;
    const Usable u = UsableOf(slot, threshold);
    const V factor = hn::Load(d, slot + 4 * lanes);
    const V predicted = Dot(u.l, answer.n);
    const V variance =
        hn::Mul(factor, hn::MulAdd(FigureOf(figures, kShot), hn::Max(predicted, least),
                                   hn::Mul(factor, FigureOf(figures, kReadSquared))));
    const V weight = hn::IfThenElseZero(
        u.is, RoughReciprocalOf(hn::Clamp(variance, hn::Set(d, 1e-9F), hn::Set(d, 1e9F))));
    const V r = hn::Sub(u.i, predicted);
    const V weighted = hn::Mul(weight, r);
    answer.sum_of_squares = hn::MulAdd(r, r, answer.sum_of_squares);
    chi_squared = hn::MulAdd(weighted, r, chi_squared);
    AddOuter(u.l, weight, a);
    AddScaled(u.l, weighted, gradient);
  }
  const Inverse inverse = Invert(a, params.max_condition_squared * kWeightedConditionFactor);
  const Vector3 step = Times(inverse.a, gradient);
  answer.n = {hn::Add(answer.n.x, step.x), hn::Add(answer.n.y, step.y),
              hn::Add(answer.n.z, step.z)};
  answer.accepted = hn::And(answer.accepted, inverse.accepted);
  chi_squared = hn::Max(hn::Sub(chi_squared, Dot(gradient, step)), zero);
  const V unit = hn::Set(d, params.noise_unit);
  const V one = hn::Set(d, 1.0F);
  const V freedom = hn::Sub(answer.count, hn::Set(d, 3.0F));
  answer.misfit = hn::IfThenElseZero(hn::Gt(freedom, zero),
                                     hn::Div(chi_squared, hn::Mul(unit, hn::Max(freedom, one))));
  const Variances variances = VariancesOf(inverse.a, answer.n);
  answer.uncertainty_deg =
      hn::Mul(RoughRootOf(hn::Mul(variances.angular, unit)), hn::Set(d, kDegreesPerRadian));
  answer.albedo_uncertainty = RoughRootOf(hn::Mul(variances.albedo, unit));
}

template <bool kDistant>
HWY_INLINE void SolveSites(const MosaicKernelParams& params, const MosaicKernelInput& input,
                           size_t offset, const RowState& state, const MosaicKernelOutput& output) {
  const D d;
  const DI di;
  const M inside = InsideOf(input.mask, offset);
  const Readings readings = GatherReadings<kDistant>(params, input, offset, state);
  const float* scratch = state.scratch.get();
  const V threshold = hn::Mul(readings.brightest, hn::Set(d, params.shadow_level));
  Inverse inverse;
  SiteAnswer answer = PlainLeastSquares(params, scratch, threshold, inverse);
  if (params.weighted) {
    WeightedSiteStep(params, state, offset, threshold, answer);
  } else {
    ResidualStep(params, scratch, threshold, inverse, answer);
  }
  const V one = hn::Set(d, 1.0F);
  const M enough = hn::Ge(answer.count, hn::Set(d, 3.0F));
  const V squared = Dot(answer.n, answer.n);
  const M finite = hn::And(hn::Gt(squared, hn::Zero(d)), hn::Lt(squared, hn::Set(d, 1e38F)));
  const M accepted = hn::And(answer.accepted, finite);
  const M solved = hn::And(hn::And(inside, readings.bright), hn::And(enough, accepted));
  const V length = hn::Sqrt(hn::IfThenElse(solved, squared, one));
  const V inverse_length = hn::Div(one, length);
  const V result_scale = hn::Set(d, params.result_scale);
  const auto store = [&](V value, float* to) HWY_ATTR {
    hn::StoreU(hn::IfThenElseZero(solved, value), d, to + offset);
  };
  store(hn::Mul(answer.n.x, inverse_length), output.normal[0]);
  store(hn::Mul(answer.n.y, inverse_length), output.normal[1]);
  store(hn::Mul(answer.n.z, inverse_length), output.normal[2]);
  store(hn::Mul(length, result_scale), output.albedo);
  const V mean = hn::Div(answer.sum_of_squares, hn::Max(answer.count, one));
  store(hn::Mul(hn::Sqrt(mean), result_scale), output.residual);
  if (params.weighted) {
    store(answer.uncertainty_deg, output.uncertainty);
    store(hn::Min(answer.albedo_uncertainty, one), output.albedo_uncertainty);
    store(answer.misfit, output.misfit);
  }
  const auto inside_bits = hn::RebindMask(di, inside);
  StoreBytes(
      hn::IfThenElseZero(inside_bits, hn::Min(hn::ConvertTo(di, answer.count), hn::Set(di, 255))),
      output.samples + offset);
  StoreBytes(hn::IfThenElseZero(inside_bits,
                                ReasonOf(readings.saturated, readings.bright, enough, accepted)),
             output.reason + offset);
}

// Calls body for every vector of a row. The last one overlaps the one before.
template <typename Body>
HWY_INLINE void ForEachVectorOfRow(size_t count, const Body& body) {
  const size_t lanes = hn::Lanes(D());
  SATEEN_CHECK(count >= lanes);
  size_t offset = 0;
  for (; offset + lanes <= count; offset += lanes) {
    body(offset);
  }
  if (offset < count) {
    body(count - lanes);
  }
}

void SolveMosaicRowImpl(const MosaicKernelParams& params, const MosaicKernelInput& input,
                        const MosaicKernelOutput& output) {
  const FlushSubnormals flush;
  const RowState state = RowStateFor(params, input.row);
  ForEachVectorOfRow(input.count, [&](size_t offset) HWY_ATTR {
    if (input.x_mm == nullptr) {
      SolveSites<true>(params, input, offset, state, output);
    } else {
      SolveSites<false>(params, input, offset, state, output);
    }
  });
}

}  // namespace
}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sateen {

HWY_EXPORT(SolveMosaicRowImpl);
HWY_EXPORT(InterpolateAlbedoRowImpl);

void SolveMosaicRow(const MosaicKernelParams& params, const MosaicKernelInput& input,
                    const MosaicKernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(SolveMosaicRowImpl)(params, input, output);
}

void InterpolateAlbedoRow(const std::array<uint8_t, 4>& cfa, int row, const OwnColours& own,
                          size_t width, const std::array<float*, 3>& albedo) {
  HWY_DYNAMIC_DISPATCH(InterpolateAlbedoRowImpl)(cfa, row, own, width, albedo);
}

}  // namespace sateen
#endif  // HWY_ONCE
