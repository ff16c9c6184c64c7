// Spans of any length as whole vectors, for solver/kernels/fast_kernel.cc, and vectors that need no
// solve. Compiled once per instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_FAST_KERNEL_SPANS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_FAST_KERNEL_SPANS_INL_H_
#undef SATEEN_SOLVER_FAST_KERNEL_SPANS_INL_H_
#else
#define SATEEN_SOLVER_FAST_KERNEL_SPANS_INL_H_
#endif

#include <algorithm>
#include <vector>

#include "solver/kernels/fast_kernel.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/lambertian.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
// Stores a vector that is wholly outside the mask.
HWY_INLINE void StoreUnsolved(size_t offset, const KernelOutput& output) {
  const D d;
  for (size_t c = 0; c < 3; ++c) {
    hn::StoreU(hn::Zero(d), d, output.normal[c] + offset);
    hn::StoreU(hn::Zero(d), d, output.albedo[c] + offset);
  }
  hn::StoreU(hn::Zero(d), d, output.residual + offset);
  if (output.uncertainty != nullptr) {
    hn::StoreU(hn::Zero(d), d, output.uncertainty + offset);
    hn::StoreU(hn::Zero(d), d, output.albedo_uncertainty + offset);
    hn::StoreU(hn::Zero(d), d, output.misfit + offset);
    StoreBytes(hn::Zero(DI()), output.model + offset);
  }
  StoreBytes(hn::Zero(DI()), output.samples + offset);
  StoreBytes(hn::Set(DI(), static_cast<int32_t>(Reason::kOutsideMask)), output.reason + offset);
}

// Runs `solve(input, offset, output)` over whole vectors, then over a padded copy of the rest.
template <typename Solve>
HWY_INLINE void ForEachVector(const KernelParams& params, const KernelInput& input,
                              const KernelOutput& output, const Solve& solve) {
  const size_t lanes = hn::Lanes(D());
  const size_t whole = input.count / lanes * lanes;
  for (size_t offset = 0; offset < whole; offset += lanes) {
    solve(input, offset, output);
  }
  const size_t rest = input.count - whole;
  if (rest == 0) {
    return;
  }
  const size_t plane_count = 3 * params.lights.size();
  const size_t light_count = params.lights.size();
  std::vector<float> padded((plane_count + 3 + light_count) * lanes, 0.0F);
  std::vector<const float*> planes(plane_count);
  const auto pad = [&](size_t index, const float* from) {
    std::copy_n(from + whole, rest, padded.begin() + static_cast<std::ptrdiff_t>(index * lanes));
    return padded.data() + index * lanes;
  };
  for (size_t p = 0; p < plane_count; ++p) {
    planes[p] = pad(p, input.planes[p]);
  }
  KernelInput tail{.planes = planes.data(), .count = lanes, .noise_scale = input.noise_scale};
  if (input.x_mm != nullptr) {
    tail.x_mm = pad(plane_count, input.x_mm);
    tail.y_mm = pad(plane_count + 1, input.y_mm);
  }
  if (input.z_mm != nullptr) {
    tail.z_mm = pad(plane_count + 2, input.z_mm);
  }
  std::vector<const float*> gains(light_count, nullptr);
  for (size_t k = 0; input.inverse_gains != nullptr && k < light_count; ++k) {
    if (input.inverse_gains[k] != nullptr) {
      gains[k] = pad(plane_count + 3 + k, input.inverse_gains[k]);
    }
  }
  tail.inverse_gains = gains.data();
  std::vector<uint8_t> bytes(5 * lanes, 0);
  std::fill_n(bytes.begin(), rest, uint8_t{1});
  if (input.mask != nullptr) {
    std::copy_n(input.mask + whole, rest, bytes.begin());
  }
  tail.mask = bytes.data();
  std::vector<float> results(10 * lanes);
  const auto result = [&](size_t index) { return results.data() + index * lanes; };
  solve(tail, 0,
        KernelOutput{.normal = {result(0), result(1), result(2)},
                     .albedo = {result(3), result(4), result(5)},
                     .residual = result(6),
                     .samples = bytes.data() + lanes,
                     .reason = bytes.data() + 2 * lanes,
                     .uncertainty = result(7),
                     .albedo_uncertainty = result(9),
                     .misfit = result(8),
                     .model = bytes.data() + 4 * lanes,
                     .agreeing = bytes.data() + 3 * lanes});
  for (size_t c = 0; c < 3; ++c) {
    std::copy_n(result(c), rest, output.normal[c] + whole);
    std::copy_n(result(3 + c), rest, output.albedo[c] + whole);
  }
  std::copy_n(result(6), rest, output.residual + whole);
  if (output.uncertainty != nullptr) {
    std::copy_n(result(7), rest, output.uncertainty + whole);
    std::copy_n(result(9), rest, output.albedo_uncertainty + whole);
  }
  if (output.misfit != nullptr) {
    std::copy_n(result(8), rest, output.misfit + whole);
    std::copy_n(bytes.data() + 4 * lanes, rest, output.model + whole);
  }
  if (output.agreeing != nullptr) {
    std::copy_n(bytes.data() + 3 * lanes, rest, output.agreeing + whole);
  }
  std::copy_n(bytes.data() + lanes, rest, output.samples + whole);
  std::copy_n(bytes.data() + 2 * lanes, rest, output.reason + whole);
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
