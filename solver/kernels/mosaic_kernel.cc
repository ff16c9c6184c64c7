#include "solver/kernels/mosaic_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/kernels/mosaic_kernel.cc"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/aligned_allocator.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>
#include <vector>

#include "core/check.h"
#include "solver/kernels/fast_kernel_equations-inl.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/kernels/fast_kernel_weights-inl.h"
#include "solver/lambertian.h"
#include "solver/noise.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
namespace {

// Scratch vectors of one light: l, i', and what radiance is multiplied by to be i'.
constexpr size_t kMosaicScratch = 5;

// Vectors of a light's figures for the sites of a row, which alternate between two of the pattern.
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
  hwy::AlignedFreeUniquePtr<float[]> figures;  // [light][figure] for even, then for odd offsets

  [[nodiscard]] HWY_INLINE const float* FiguresOf(size_t k, size_t lights, size_t offset) const {
    return figures.get() + ((offset % 2) * lights + k) * kSiteFigures * hn::Lanes(D());
  }
};

RowState RowStateFor(const MosaicKernelParams& params, int row) {
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

struct Arrival {
  Vector3 l;
  V inverse_gain;  // 0 behind an LED
};

template <bool kDistant>
HWY_INLINE Arrival ArrivalOf(const MosaicKernelLight& light, const MosaicKernelInput& input,
                             size_t k, size_t offset) {
  const D d;
  const Vector3 place{hn::Set(d, light.place[0]), hn::Set(d, light.place[1]),
                      hn::Set(d, light.place[2])};
  if (kDistant || light.model == LightModel::kDistant) {
    return {place, hn::Set(d, 1.0F)};
  }
  const Vector3 to_light{
      hn::Sub(place.x, hn::LoadU(d, input.x_mm + offset)),
      hn::Sub(place.y, hn::LoadU(d, input.y_mm + offset)),
      input.z_mm == nullptr ? place.z : hn::Sub(place.z, hn::LoadU(d, input.z_mm + offset))};
  const V squared = Dot(to_light, to_light);
  const V inverse = ReciprocalRootOf(squared);
  Arrival in{
      {hn::Mul(to_light.x, inverse), hn::Mul(to_light.y, inverse), hn::Mul(to_light.z, inverse)},
      squared};
  if (!IsLed(light.model)) {
    return in;
  }
  const Vector3 axis{hn::Set(d, light.axis[0]), hn::Set(d, light.axis[1]),
                     hn::Set(d, light.axis[2])};
  const V cosine = hn::Neg(Dot(in.l, axis));
  const M before = hn::Gt(cosine, hn::Zero(d));
  const V safe = hn::IfThenElse(before, cosine, hn::Set(d, 1.0F));
  const V falloff = light.anisotropy == 1.0F
                        ? ReciprocalOf(safe)
                        : hn::Exp(d, hn::Mul(hn::Set(d, -light.anisotropy), hn::Log(d, safe)));
  in.inverse_gain = hn::IfThenElseZero(before, hn::Mul(squared, falloff));
  if (light.model == LightModel::kLedField) {
    in.inverse_gain = hn::Mul(in.inverse_gain, hn::LoadU(d, input.inverse_gains[k] + offset));
  }
  return in;
}

HWY_INLINE V LoadReadings(const uint16_t* from) {
  const D d;
  const hn::Rebind<uint16_t, D> du16;
  return hn::ConvertTo(d, hn::PromoteTo(DI(), hn::LoadU(du16, from)));
}

struct Readings {
  V brightest;  // largest i'_k that is not saturated
  V saturated;  // how many are
  M bright;     // some reading is above its dark level
};

// Fills the scratch; i' is -1 where the reading is saturated.
template <bool kDistant>
HWY_INLINE Readings GatherReadings(const MosaicKernelParams& params, const MosaicKernelInput& input,
                                   size_t offset, const RowState& state) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  Readings readings{zero, zero, NoLanes()};
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
    const Arrival in = ArrivalOf<kDistant>(light, input, k, offset);
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

// A light's l and i' of the usable readings, zero elsewhere.
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

struct SiteAnswer {
  Vector3 n;  // N
  V sum_of_squares;
  V count;
  V misfit;
  V uncertainty_deg;
  V albedo_uncertainty;
  M accepted;
};

// Equations (1) and (3) of solver/lambertian.h for one channel; n is refined by ResidualStep().
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

// Equations (2) and (3) of solver/mosaic/mosaic.h.
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

HWY_INLINE VI SiteReason(const Readings& readings, M enough, M accepted) {
  const DI di;
  const auto code = [&](Reason reason) { return hn::Set(di, static_cast<int32_t>(reason)); };
  const auto bits = [&](M mask) { return hn::RebindMask(di, mask); };
  const M some_saturated = hn::Gt(readings.saturated, hn::Zero(D()));
  const VI too_few =
      hn::IfThenElse(bits(some_saturated), code(Reason::kSaturated), code(Reason::kTooFewSamples));
  const VI answered =
      hn::IfThenElse(bits(accepted), code(Reason::kSolved), code(Reason::kIllConditioned));
  return hn::IfThenElse(bits(readings.bright), hn::IfThenElse(bits(enough), answered, too_few),
                        code(Reason::kDark));
}

template <bool kDistant>
HWY_INLINE void SolveSites(const MosaicKernelParams& params, const MosaicKernelInput& input,
                           size_t offset, const RowState& state, const MosaicKernelOutput& output) {
  const D d;
  const DI di;
  M inside = hn::Not(NoLanes());
  if (input.mask != nullptr) {
    const hn::Rebind<uint8_t, D> du8;
    const VI mask = hn::PromoteTo(di, hn::LoadU(du8, input.mask + offset));
    inside = hn::RebindMask(d, hn::Ne(mask, hn::Zero(di)));
  }
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
  StoreBytes(hn::IfThenElseZero(inside_bits, SiteReason(readings, enough, accepted)),
             output.reason + offset);
}

// The last vector of a row overlaps the one before.
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

// Neighbours in three rows: beside, above and below, at the corners.
struct Around {
  V beside, above, corners;
};

// Unsolved neighbours are zero. `count`: how many are not.
HWY_INLINE Around SumAround(const float* a, const float* h, const float* b, bool count) {
  const D d;
  const auto load = [&](const float* from) HWY_ATTR {
    const V value = hn::LoadU(d, from);
    return count ? hn::IfThenElseZero(hn::Gt(value, hn::Zero(d)), hn::Set(d, 1.0F)) : value;
  };
  return {hn::Add(load(h - 1), load(h + 1)), hn::Add(load(a), load(b)),
          hn::Add(hn::Add(load(a - 1), load(a + 1)), hn::Add(load(b - 1), load(b + 1)))};
}

// Which neighbours are of a colour, as 1 and 0, at the sites of a vector that begins at an even one.
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

void InterpolateAlbedoRowImpl(const std::array<uint8_t, 4>& cfa, int row, const OwnColours& own,
                              size_t width, const std::array<float*, 3>& albedo) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  // Each between zeros, with a whole vector of them at the end.
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

void TouchMosaicRowImpl(const MosaicKernelParams& params, const MosaicKernelInput& input,
                        const MosaicKernelOutput& output) {
  ForEachVectorOfRow(input.count, [&](size_t offset) HWY_ATTR {
    const D d;
    V sum = hn::Zero(d);
    for (size_t k = 0; k < params.lights.size(); ++k) {
      sum = hn::Add(sum, LoadReadings(input.readings[k] + offset));
    }
    for (float* to :
         {output.normal[0], output.normal[1], output.normal[2], output.albedo, output.residual}) {
      hn::StoreU(sum, d, to + offset);
    }
    StoreBytes(hn::Set(DI(), 1), output.samples + offset);
    StoreBytes(hn::Set(DI(), 1), output.reason + offset);
  });
}

}  // namespace
}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sateen {

HWY_EXPORT(SolveMosaicRowImpl);
HWY_EXPORT(TouchMosaicRowImpl);
HWY_EXPORT(InterpolateAlbedoRowImpl);

void SolveMosaicRow(const MosaicKernelParams& params, const MosaicKernelInput& input,
                    const MosaicKernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(SolveMosaicRowImpl)(params, input, output);
}

void TouchMosaicRow(const MosaicKernelParams& params, const MosaicKernelInput& input,
                    const MosaicKernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(TouchMosaicRowImpl)(params, input, output);
}

void InterpolateAlbedoRow(const std::array<uint8_t, 4>& cfa, int row, const OwnColours& own,
                          size_t width, const std::array<float*, 3>& albedo) {
  HWY_DYNAMIC_DISPATCH(InterpolateAlbedoRowImpl)(cfa, row, own, width, albedo);
}

}  // namespace sateen
#endif  // HWY_ONCE
