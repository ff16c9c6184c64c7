#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "rig/light.h"

namespace sateen {

// Place and direction of a light, in float.
struct KernelLamp {
  LightModel model = LightModel::kDistant;
  std::array<float, 3> place = {};  // distant: l; otherwise position_mm
  std::array<float, 3> axis = {};
  float anisotropy = 0.0F;
};
[[nodiscard]] KernelLamp KernelLampOf(const Light& light);

// One light of the kernel.
struct KernelLight {
  KernelLamp lamp;
  std::array<float, 3> inverse_flux = {};  // distant: 1 / phi; otherwise 1 / (phi 1e6 mm^2)
  float clip = 0.0F;                       // radiance at or above this is saturated
  float dark = 0.0F;                       // radiance above this is not dark
  // Variance of i / flux, without the light's factor for the place, is shot i / flux +
  // read_squared; red, green, blue. For SolveWeightedSpan alone.
  std::array<float, 3> shot = {};
  std::array<float, 3> read_squared = {};
};

struct KernelParams {
  std::vector<KernelLight> lights;
  // Factor on results: the power of two that keeps i' near 1 and is left out of inverse_flux.
  float result_scale = 1.0F;
  float shadow_level = 0.0F;
  // Largest bound on the condition number of L^T L; above it a pixel is refused.
  float max_condition_squared = 0.0F;
};

// `count` consecutive pixels. Planes are 3 K pointers to the first of them, r g b of light 0 first.
struct KernelInput {
  const float* const* planes = nullptr;
  const float* x_mm = nullptr;  // table positions; null when every light is distant
  const float* y_mm = nullptr;
  const float* z_mm = nullptr;  // heights above the table; null: 0
  // K pointers to 1 / g of each light's field, null for a light without one; null when no light has
  // one.
  const float* const* inverse_gains = nullptr;
  const uint8_t* mask = nullptr;  // 0 outside; null: all inside
  size_t count = 0;
  // s of solver/robust/noise_scale.h, infinite where unknown. For SolveWeightedSpan alone.
  float noise_scale = 1.0F;
};

struct KernelOutput {
  std::array<float*, 3> normal = {};
  std::array<float*, 3> albedo = {};
  float* residual = nullptr;
  uint8_t* samples = nullptr;
  uint8_t* reason = nullptr;
  // SolveWeightedSpan and SolveConsensusSpan only.
  float* uncertainty = nullptr;         // degrees
  float* albedo_uncertainty = nullptr;  // relative
  // SolveWeightedSpan only: chi^2 over its degrees of freedom, 0 where there are none, and the rung.
  float* misfit = nullptr;
  uint8_t* model = nullptr;
  // SolveConsensusSpan only: usable samples that agree with the normal.
  uint8_t* agreeing = nullptr;
};

// Bound on cond(L^T L) up to which kFast answers: a true cond(L) of about 14. There, on noiseless
// data, the error of float is 2e-5 degrees on average and 7e-5 at most, three times the
// reference's.
inline constexpr float kFloatConditionSquared = 400.0F;

/// Solves (1) to (4) of solver/lambertian.h in float, one pixel per lane.
///
/// L^T L is inverted by its adjugate; N gets one step of refinement from the residuals of (3), so
/// its error grows with the condition number of L and not with its square. Pixels whose bound
///
///     cond(L^T L) <= trace(L^T L) * (sum of principal 2x2 minors) / det
///
/// exceeds max_condition_squared are refused: kIllConditioned. Radiance from the smallest float to
/// 1e30 gives the same answer times its scale: pixels far from 1 are first scaled by a power of
/// two. Subnormal numbers are scaled by integer arithmetic, because the processor's assists for
/// them cost a hundred times the solve.
void SolveSpan(const KernelParams& params, const KernelInput& input, const KernelOutput& output);

/// Solves (1) to (5) of solver/least_squares/weighted.h: SolveSpan, then one step to the normal
/// that is weighted by the samples' noise. `misfit`, `model` and both uncertainties must be set.
/// Costs 1.4 times SolveSpan.
void SolveWeightedSpan(const KernelParams& params, const KernelInput& input,
                       const KernelOutput& output);

/// Solves (1) to (6) of solver/robust/consensus.h, for pixels that least squares do not explain.
/// x_mm and y_mm must be set, also for distant lights; `agreeing` and both uncertainties must be
/// set. `misfit` is not written. Pixels without an answer are not kSolved.
void SolveConsensusSpan(const KernelParams& params, const KernelInput& input,
                        const KernelOutput& output);

// Returns the instruction set that SolveSpan uses on this machine: "AVX3", "AVX2", "SSE4", ...
[[nodiscard]] std::string_view KernelInstructionSet();

}  // namespace sateen
