#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/lambertian.h"
#include "solver/least_squares/pixel_geometry.h"
#include "solver/noise.h"
#include "solver/solve_input.h"

namespace sateen {

// Pixels anywhere in a stack with their geometry, side by side so that every lane of a vector has
// work.
struct ListedPixels {
  std::vector<size_t> pixels;
  std::vector<float> x_mm;  // zero where all lights are distant
  std::vector<float> y_mm;
  std::vector<float> z_mm;                // empty where the surface is the table plane
  std::vector<std::vector<float>> gains;  // per light; empty without a field

  // Appends pixels whose geometry starts with pixel `first`.
  void Append(const PixelGeometry& geometry, size_t first, std::span<const size_t> more);
};

// Feeds rows of a stack to the kernel. Borrows the stack and the mask for the time of one solve;
// both must have been checked, as SolveLambertian does.
class FastRows {
 public:
  // Fails with kBadData where a near light needs table positions and a pixel does not see the
  // table.
  [[nodiscard]] static Result<FastRows> Make(const FramesInput& input,
                                             const LambertianOptions& options,
                                             const StackNoise* noise = nullptr);

  // Returns the geometry of rows [begin, end).
  [[nodiscard]] PixelGeometry GeometryOf(int begin, int end) const;

  // Solves rows [begin, end) into `field`; refused pixels are kIllConditioned.
  void Solve(int begin, int end, NormalField& field) const;
  // Solves with weights, for which Make() must have had noise: also writes both uncertainties,
  // times noise_scale, field.model and the misfit of each pixel.
  void SolveWeighted(int begin, int end, const PixelGeometry& geometry, double noise_scale,
                     NormalField& field, std::span<float> misfits) const;
  // Computes misfit, usable samples and reason of pixels anywhere, in order of their indices.
  void MisfitsAt(std::span<const size_t> pixels, std::span<float> misfits,
                 std::span<uint8_t> samples, std::span<uint8_t> reasons) const;
  // Solves listed pixels on rung 2 into `field`. The content of other pixels stays, and so does
  // that of a listed pixel without an answer. `agreeing` receives the number of samples that agree,
  // 0 without an answer.
  void SolveConsensus(const ListedPixels& listed, NormalField& field,
                      std::span<uint8_t> agreeing) const;

 private:
  using SpanFunction = void (*)(const KernelParams&, const KernelInput&, const KernelOutput&);

  FastRows(const FramesInput& input, PixelLocator locator)
      : stack_(&input.stack), mask_(input.mask), locator_(std::move(locator)) {}
  void Run(SpanFunction function, int begin, int end, const PixelGeometry& geometry,
           NormalField& field, float* misfits, double noise_scale = 1.0) const;
  // Runs `function` over listed pixels.
  void RunListed(SpanFunction function, const ListedPixels& listed, bool has_positions,
                 const KernelOutput& output) const;

  const LightStack* stack_;
  const Mask* mask_;  // null: all pixels
  PixelLocator locator_;
  KernelParams params_;
};

// Returns the number of rows per thread and step: about 8,000 pixels, so that positions stay in its
// cache.
[[nodiscard]] int RowsPerPiece(ImageSize size);

// Returns the irradiance at the table's origin of a light's green flux, or phi of a distant light.
[[nodiscard]] double TypicalIrradiance(const Light& light);
// Returns the power of two next to the geometric mean of TypicalIrradiance(): fluxes come in any
// unit.
[[nodiscard]] double FluxScale(const Lights& lights);

}  // namespace sateen
