#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "rig/light.h"

namespace sateen {

// One light as the kernel wants it.
struct KernelLight {
  LightModel model = LightModel::kDistant;
  std::array<float, 3> place = {};  // distant: l; otherwise position_mm
  std::array<float, 3> axis = {};
  float anisotropy = 0.0F;
  std::array<float, 3> inverse_flux = {};  // distant: 1 / phi; otherwise 1 / (phi 1e6 mm^2)
  float clip = 0.0F;                       // radiance at or above is saturated
  float dark = 0.0F;                       // radiance above is not dark
  // Variance of i', i / flux with the light's factor for the place left out: shot i' + read_squared,
  // red, green, blue. For SolveWeightedSpan alone.
  std::array<float, 3> shot = {};
  std::array<float, 3> read_squared = {};
};

struct KernelParams {
  std::vector<KernelLight> lights;
  // inverse_flux times this is what was asked: a power of two that keeps i' near 1.
  float result_scale = 1.0F;
  float shadow_level = 0.0F;
  // Refuse where the bound on the condition number of L^T L is above this.
  float max_condition_squared = 0.0F;
};

// `count` consecutive pixels. Planes are 3 K pointers to the first of them, r g b of light 0 first.
struct KernelInput {
  const float* const* planes = nullptr;
  const float* x_mm = nullptr;  // table positions; null when every light is distant
  const float* y_mm = nullptr;
  const float* z_mm = nullptr;  // heights above the table; null: 0
  // K pointers to 1 / g of each light's field, null for a light without; null when no light has one.
  const float* const* inverse_gains = nullptr;
  const uint8_t* mask = nullptr;  // 0 outside; null: all inside
  size_t count = 0;
  // SolveWeightedSpan: s of solver/ladder.h, infinity where it is not known.
  float noise_scale = 1.0F;
};

struct KernelOutput {
  std::array<float*, 3> normal = {};
  std::array<float*, 3> albedo = {};
  float* residual = nullptr;
  uint8_t* samples = nullptr;
  uint8_t* reason = nullptr;
  // SolveWeightedSpan and SolveConsensusSpan.
  float* uncertainty = nullptr;         // degrees
  float* albedo_uncertainty = nullptr;  // of 1
  // SolveWeightedSpan: chi^2 over its degrees of freedom, 0 where there is none, and the rung.
  float* misfit = nullptr;
  uint8_t* model = nullptr;
  // SolveConsensusSpan: usable samples that agree with the normal.
  uint8_t* agreeing = nullptr;
};

// Bound on cond(L^T L) up to which kFast answers: a true cond(L) of about 14. There, on noiseless
// data, float leaves 2e-5 degrees in the mean and 7e-5 at most, three times the reference.
inline constexpr float kFloatConditionSquared = 400.0F;

/// Equations (1) to (4) of solver/lambertian.h in float, one pixel a lane.
///
/// L^T L is inverted by its adjugate; N gets one step of refinement from the residuals of (3), so
/// its error grows with the condition number of L and not with its square. Pixels whose bound
///
///     cond(L^T L) <= trace(L^T L) * (sum of principal 2x2 minors) / det
///
/// exceeds max_condition_squared are refused: kIllConditioned. Radiance from the smallest float to
/// 1e30 gives the same answer times its scale: pixels far from 1 are brought there by a power of
/// two first, subnormal numbers by integer arithmetic, because floating-point assists for them
/// cost a hundred times the solve.
void SolveSpan(const KernelParams& params, const KernelInput& input, const KernelOutput& output);

/// The same, then one step to the normal that has the samples' noise for weights (equations (1) to
/// (5) of solver/ladder.h); `misfit`, `model` and both uncertainties must be there. Costs 1.4 times SolveSpan.
void SolveWeightedSpan(const KernelParams& params, const KernelInput& input,
                       const KernelOutput& output);

/// Equations (6) to (11) of solver/ladder.h, for pixels that least squares do not explain.
/// `agreeing` and both uncertainties must be there, `misfit` is not touched; pixels without an answer
/// are not kSolved. x_mm and y_mm must be there, also for distant lights.
void SolveConsensusSpan(const KernelParams& params, const KernelInput& input,
                        const KernelOutput& output);

// Sums the same planes and writes the same outputs, nothing else: the memory bandwidth that the
// access pattern of SolveSpan allows.
void TouchSpan(const KernelParams& params, const KernelInput& input, const KernelOutput& output);

// What SolveSpan was compiled for on this machine: "AVX3", "AVX2", "SSE4", ...
[[nodiscard]] std::string_view KernelInstructionSet();

}  // namespace sateen
