#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "imaging/mosaic_stack.h"
#include "solver/kernels/fast_kernel.h"

namespace sateen {

// One light of the mosaic kernel, per site of the 2x2 pattern where the colours differ. f = 1 / phi
// of the site's colour for distant lights, otherwise 1 / (phi 1e6 mm^2).
struct MosaicKernelLight {
  KernelLamp lamp;
  float clip_dn = 0.0F;      // a reading of this or more is saturated
  BySite inverse_flux = {};  // f
  BySite per_dn = {};        // f radiance = per_dn reading + at_zero - f dark
  BySite at_zero = {};
  BySite least = {};  // f radiance above this is not dark
  // Variance of f radiance = f (shot f radiance + f read_squared), in units of noise_unit.
  BySite shot = {};
  BySite read_squared = {};
};

struct MosaicKernelParams {
  std::vector<MosaicKernelLight> lights;
  // Factor on results: the power of two that keeps i' near 1 and is left out of inverse_flux.
  float result_scale = 1.0F;
  float shadow_level = 0.0F;
  // Largest bound on the condition number of L^T L; above it a site is refused.
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
  const float* z_mm = nullptr;  // heights above the table; null: 0
  // K pointers to 1 / g of each light's field, null for a light without one; null when no light has
  // one.
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
  // Weighted only; may be null without weights.
  float* uncertainty = nullptr;         // degrees
  float* albedo_uncertainty = nullptr;  // relative
  float* misfit = nullptr;              // chi^2 over its degrees of freedom, 0 where there are none
};

// Number of sites that fills a vector of any instruction set.
inline constexpr size_t kFewestSites = 64;

/// Solves one row of a mosaic by least squares, one site per lane: (1) to (3) of
/// solver/mosaic/mosaic.h in float. Sites are kIllConditioned where the bound on the condition of
/// their usable lights is above max_condition_squared. Without weights takes one step of
/// refinement, as SolveSpan does.
void SolveMosaicRow(const MosaicKernelParams& params, const MosaicKernelInput& input,
                    const MosaicKernelOutput& output);

// Albedo of each site's own colour in a row and in its neighbours; null beyond the border.
struct OwnColours {
  const float* above = nullptr;
  const float* row = nullptr;
  const float* below = nullptr;
};

// Writes the albedo of all colours in row `row` of an image: the own colour as it is, another one
// as the mean of the nearest solved sites of that colour among the eight neighbours. Where there is
// none, takes the own colour's value. Zero where the site is unsolved.
void InterpolateAlbedoRow(const std::array<uint8_t, 4>& cfa, int row, const OwnColours& own,
                          size_t width, const std::array<float*, 3>& albedo);

}  // namespace sateen
