#include "solver/kernels/fast_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/kernels/fast_kernel.cc"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "solver/kernels/consensus_kernel-inl.h"
#include "solver/kernels/fast_kernel_equations-inl.h"
#include "solver/kernels/fast_kernel_gather-inl.h"
#include "solver/kernels/fast_kernel_spans-inl.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/kernels/fast_kernel_weights-inl.h"
#include "solver/lambertian.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
// ---- One vector of pixels ----------------------------------------------------------------------

// Results of a vector of pixels, where it is accepted.
struct Answer {
  Vector3 n;  // N of the luminance
  V albedo[3];
  V sum_of_squares;
  V count;
  M accepted;
};

template <bool kDistant>
HWY_INLINE Answer SolvePlain(const KernelParams& params, const float* scratch, V threshold) {
  const NormalEquations eq = Accumulate<kDistant>(params, scratch, threshold);
  const Inverse inverse = Invert(eq.a, params.max_condition_squared);
  const Vector3 n = Times(inverse.a, LuminanceOf(eq.b));  // (3)
  const Residual residual = ResidualOf<kDistant>(params, scratch, threshold, n);
  const Vector3 step = Times(inverse.a, residual.gradient);
  Answer answer{{hn::Add(n.x, step.x), hn::Add(n.y, step.y), hn::Add(n.z, step.z)},
                {},
                residual.sum_of_squares,
                eq.count,
                inverse.accepted};
  for (size_t c = 0; c < 3; ++c) {
    const Vector3 n_c = Times(inverse.a, eq.b[c]);
    answer.albedo[c] = hn::Sqrt(Dot(n_c, n_c));  // (4)
  }
  return answer;
}

template <bool kDistant, bool kWeighted>
HWY_INLINE void SolveVector(const KernelParams& params, const KernelInput& input, size_t offset,
                            const KernelOutput& output, State& state) {
  const D d;
  const DI di;
  const V one = hn::Set(d, 1.0F);
  const M inside = InsideOf(input.mask, offset);
  if (hn::AllFalse(d, inside)) {
    StoreUnsolved(offset, output);
    return;
  }
  const Vector3 x_mm = PointsAt<kDistant>(input, offset);
  Scale scale{one, one, NoLanes()};
  const Gathered gathered = GatherScaled<kDistant>(params, input, offset, x_mm, scale, state);
  float* scratch = state.scratch.get();
  const V threshold = hn::Mul(gathered.brightest, hn::Set(d, params.shadow_level));
  Answer answer;
  Weighted weighted;
  if constexpr (kWeighted) {
    weighted = hn::AllTrue(d, hn::Gt(gathered.dimmest, threshold))
                   ? SolveWeighted<kDistant, true>(params, scratch, threshold, scale)
                   : SolveWeighted<kDistant, false>(params, scratch, threshold, scale);
    answer = {weighted.n, {}, weighted.sum_of_squares, weighted.count, weighted.accepted};
  } else {
    answer = SolvePlain<kDistant>(params, scratch, threshold);
  }
  const V squared = Dot(answer.n, answer.n);
  const M finite = hn::And(hn::Gt(squared, hn::Zero(d)), hn::Lt(squared, hn::Set(d, 1e38F)));
  const M enough = hn::Ge(answer.count, hn::Set(d, 3.0F));
  const M accepted = hn::And(answer.accepted, finite);
  const M solved = hn::And(hn::And(inside, gathered.bright), hn::And(enough, accepted));
  const V length = hn::Sqrt(hn::IfThenElse(solved, squared, one));
  const V inverse_length = hn::Div(one, length);  // (4)
  const V result_scale = hn::Set(d, params.result_scale);
  const auto store = [&](V value, float* to) {
    hn::StoreU(hn::IfThenElseZero(solved, value), d, to + offset);
  };
  store(hn::Mul(answer.n.x, inverse_length), output.normal[0]);
  store(hn::Mul(answer.n.y, inverse_length), output.normal[1]);
  store(hn::Mul(answer.n.z, inverse_length), output.normal[2]);
  for (size_t c = 0; c < 3; ++c) {
    const V albedo = kWeighted ? hn::Mul(weighted.colour[c], length) : answer.albedo[c];
    store(ScaleDown(hn::Mul(albedo, result_scale), scale), output.albedo[c]);
  }
  const V mean = hn::Div(answer.sum_of_squares, hn::Max(answer.count, one));
  store(ScaleDown(hn::Mul(hn::Sqrt(mean), result_scale), scale), output.residual);
  if constexpr (kWeighted) {
    const V uncertainty =
        hn::Mul(weighted.uncertainty_deg, hn::Set(d, input.noise_scale));  // not a number: unknown
    const V unknown = hn::Set(d, 180.0F);
    store(hn::IfThenElse(hn::Lt(uncertainty, unknown), uncertainty, unknown), output.uncertainty);
    const V of_albedo = hn::Mul(weighted.albedo_uncertainty, hn::Set(d, input.noise_scale));
    store(hn::IfThenElse(hn::Lt(of_albedo, one), of_albedo, one), output.albedo_uncertainty);
    store(weighted.misfit, output.misfit);
    const M unchecked = hn::Le(answer.count, hn::Set(d, 3.0F));
    const VI rung = hn::IfThenElse(hn::RebindMask(di, unchecked),
                                   hn::Set(di, static_cast<int32_t>(Rung::kUnchecked)),
                                   hn::Set(di, static_cast<int32_t>(Rung::kLeastSquares)));
    StoreBytes(hn::IfThenElseZero(hn::RebindMask(di, solved), rung), output.model + offset);
  }
  const auto inside_bits = hn::RebindMask(di, inside);
  StoreBytes(
      hn::IfThenElseZero(inside_bits, hn::Min(hn::ConvertTo(di, answer.count), hn::Set(di, 255))),
      output.samples + offset);
  StoreBytes(hn::IfThenElseZero(inside_bits,
                                ReasonOf(gathered.saturated, gathered.bright, enough, accepted)),
             output.reason + offset);
}

State StateFor(const KernelParams& params) {
  return {hwy::AllocateAligned<float>(params.lights.size() * kScratchPerLight * hn::Lanes(D()))};
}

template <bool kWeighted>
HWY_INLINE void SolveSpanAs(const KernelParams& params, const KernelInput& input,
                            const KernelOutput& output) {
  const FlushSubnormals flush;
  State state = StateFor(params);
  if (input.x_mm == nullptr) {
    ForEachVector(params, input, output,
                  [&](const KernelInput& in, size_t offset, const KernelOutput& out)
                      HWY_ATTR { SolveVector<true, kWeighted>(params, in, offset, out, state); });
  } else {
    ForEachVector(params, input, output,
                  [&](const KernelInput& in, size_t offset, const KernelOutput& out)
                      HWY_ATTR { SolveVector<false, kWeighted>(params, in, offset, out, state); });
  }
}

void SolveSpanImpl(const KernelParams& params, const KernelInput& input,
                   const KernelOutput& output) {
  SolveSpanAs<false>(params, input, output);
}

void SolveWeightedSpanImpl(const KernelParams& params, const KernelInput& input,
                           const KernelOutput& output) {
  SolveSpanAs<true>(params, input, output);
}

void SolveConsensusSpanImpl(const KernelParams& params, const KernelInput& input,
                            const KernelOutput& output) {
  const FlushSubnormals flush;
  State state = StateFor(params);
  const auto ranks = hwy::AllocateAligned<float>(2 * params.lights.size() * hn::Lanes(D()));
  ForEachVector(
      params, input, output,
      [&](const KernelInput& in, size_t offset, const KernelOutput& out) HWY_ATTR {
        Scale scale{hn::Set(D(), 1.0F), hn::Set(D(), 1.0F), NoLanes()};
        const Gathered gathered =
            GatherScaled<false>(params, in, offset, PointsAt<false>(in, offset), scale, state);
        ConsensusVector(params, gathered, scale, state.scratch.get(), ranks.get(), offset, out);
      });
}

std::string_view InstructionSetImpl() { return hwy::TargetName(HWY_TARGET); }

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sateen {

HWY_EXPORT(SolveSpanImpl);
HWY_EXPORT(SolveWeightedSpanImpl);
HWY_EXPORT(SolveConsensusSpanImpl);
HWY_EXPORT(InstructionSetImpl);

KernelLamp KernelLampOf(const Light& light) {
  const bool is_distant = light.model == LightModel::kDistant;
  const Eigen::Vector3f place = (is_distant ? light.direction : light.position_mm).cast<float>();
  const Eigen::Vector3f axis = light.axis.cast<float>();
  return {.model = light.model,
          .place = {place.x(), place.y(), place.z()},
          .axis = {axis.x(), axis.y(), axis.z()},
          .anisotropy = static_cast<float>(light.anisotropy)};
}

void SolveSpan(const KernelParams& params, const KernelInput& input, const KernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(SolveSpanImpl)(params, input, output);
}

void SolveWeightedSpan(const KernelParams& params, const KernelInput& input,
                       const KernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(SolveWeightedSpanImpl)(params, input, output);
}

void SolveConsensusSpan(const KernelParams& params, const KernelInput& input,
                        const KernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(SolveConsensusSpanImpl)(params, input, output);
}

std::string_view KernelInstructionSet() { return HWY_DYNAMIC_DISPATCH(InstructionSetImpl)(); }

}  // namespace sateen
#endif  // HWY_ONCE
