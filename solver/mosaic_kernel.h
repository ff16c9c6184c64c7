#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rig/light.h"
#include "solver/mosaic_stack.h"

namespace sateen {

// One light as the mosaic kernel wants it, by the site of the 2x2 pattern where the colours differ.
struct MosaicKernelLight {
  LightModel model = LightModel::kDistant;
  std::array<float, 3> place = {};  // distant: l; otherwise position_mm
  std::array<float, 3> axis = {};
  float anisotropy = 0.0F;
  BySite inverse_flux = {};  // distant: 1 / phi; otherwise 1 / (phi 1e6 mm^2)
  BySite per_dn = {};        // radiance = per_dn reading + at_zero - dark
  BySite at_zero = {};
  float clip_dn = 0.0F;  // a reading of this or more is saturated
  float dark = 0.0F;     // radiance above is not dark
  // Variance of radiance i, in units of MosaicKernelParams::noise_unit: shot i + read_squared.
  BySite shot = {};
  BySite read_squared = {};
};

struct MosaicKernelParams {
  std::vector<MosaicKernelLight> lights;
  // inverse_flux times this is what was asked: a power of two that keeps i' near 1.
  float result_scale = 1.0F;
  float shadow_level = 0.0F;
  // Refuse where the bound on the condition number of L^T L is above this.
  float max_condition_squared = 0.0F;
  bool weighted = true;
  float noise_unit = 1.0F;
};

// One row from its first site on. Readings are K pointers.
struct MosaicKernelInput {
  const uint16_t* const* readings = nullptr;
  const float* dark = nullptr;  // radiance of the dark frame; null: none
  const float* x_mm = nullptr;  // table positions; null when every light is distant
  const float* y_mm = nullptr;
  // K pointers to 1 / g of each light's field, null for a light without; null when no light has one.
  const float* const* inverse_gains = nullptr;
  const uint8_t* mask = nullptr;  // 0 outside; null: all inside
  int row = 0;
  size_t count = 0;  // at least kFewestSites
};

struct MosaicKernelOutput {
  std::array<float*, 3> normal = {};
  float* albedo = nullptr;
  float* residual = nullptr;
  uint8_t* samples = nullptr;
  uint8_t* reason = nullptr;
  float* uncertainty = nullptr;  // degrees; with weights alone, may be null without
  float* misfit = nullptr;       // chi^2 over its degrees of freedom, 0 where there is none
};

// Sites of a row that fill a vector of any instruction set.
inline constexpr size_t kFewestSites = 64;

/// Least squares of one row of a mosaic, one site a lane: equations (1) to (3) of solver/mosaic.h in
/// float. Sites of usable lights whose condition is above max_condition_squared are kIllConditioned.
/// Without weights one step of refinement, as in SolveSpan.
void SolveMosaicRow(const MosaicKernelParams& params, const MosaicKernelInput& input,
                    const MosaicKernelOutput& output);

// Reads the same readings and writes the same maps, nothing else.
void TouchMosaicRow(const MosaicKernelParams& params, const MosaicKernelInput& input,
                    const MosaicKernelOutput& output);

}  // namespace sateen
