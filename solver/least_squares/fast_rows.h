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

namespace sateen {

// Pixels anywhere in a stack, side by side with their geometry, so that every lane of a vector has work.
struct ListedPixels {
  std::vector<size_t> pixels;
  std::vector<float> x_mm;  // zero where all lights are distant
  std::vector<float> y_mm;
  std::vector<float> z_mm;                // empty where the surface is the table plane
  std::vector<std::vector<float>> gains;  // of each light; empty without a field

  // Appends pixels whose geometry starts with pixel `first`.
  void Append(const PixelGeometry& geometry, size_t first, std::span<const size_t> more);
};

// Feeds rows of a stack to the kernel. Borrows the stack and the mask, which must have been checked
// (SolveLambertian does).
class FastRows {
 public:
  // kBadData where a near light needs table positions and a pixel does not see the table.
  [[nodiscard]] static Result<FastRows> Make(const LightStack& stack, const Rig& rig,
                                             const std::optional<Mask>& mask,
                                             const LambertianOptions& options,
                                             const StackNoise* noise = nullptr);

  // Of the pixels of rows [begin, end).
  [[nodiscard]] PixelGeometry GeometryOf(int begin, int end) const;

  // Solves rows [begin, end) into `field`; refused pixels are kIllConditioned.
  void Solve(int begin, int end, NormalField& field) const;
  // With weights, for which there must be noise: also both uncertainties, times noise_scale, field.model
  // and the misfit of each pixel.
  void SolveWeighted(int begin, int end, const PixelGeometry& geometry, double noise_scale,
                     NormalField& field, std::span<float> misfits) const;
  // Misfit, usable samples and reason of pixels anywhere, in order of their indices.
  void MisfitsAt(std::span<const size_t> pixels, std::span<float> misfits,
                 std::span<uint8_t> samples, std::span<uint8_t> reasons) const;
  // Rung 2 for listed pixels, into `field`. The others' content stays, and so does that of a listed pixel
  // without an answer. `agreeing`, one for each, receives how many samples agree, 0 without an answer.
  void SolveConsensus(const ListedPixels& listed, NormalField& field,
                      std::span<uint8_t> agreeing) const;
  // Reads and writes the same bytes and only adds them up: the floor of Solve.
  void Touch(int begin, int end, NormalField& field) const;

 private:
  using SpanFunction = void (*)(const KernelParams&, const KernelInput&, const KernelOutput&);

  FastRows(const LightStack& stack, const std::optional<Mask>& mask, PixelLocator locator)
      : stack_(&stack), mask_(&mask), locator_(std::move(locator)) {}
  void Run(SpanFunction function, int begin, int end, const PixelGeometry& geometry,
           NormalField& field, float* misfits, double noise_scale = 1.0) const;
  // Runs `function` over listed pixels.
  void RunListed(SpanFunction function, const ListedPixels& listed, bool has_positions,
                 const KernelOutput& output) const;

  const LightStack* stack_;
  const std::optional<Mask>* mask_;
  PixelLocator locator_;
  KernelParams params_;
};

// Rows that one thread takes at a time: about 8,000 pixels, so that positions stay in its cache.
[[nodiscard]] int RowsPerPiece(ImageSize size);

[[nodiscard]] bool AllDistant(const Lights& lights);

// Irradiance that the light's green flux gives at the table's origin, or phi itself.
[[nodiscard]] double TypicalIrradiance(const Light& light);
// The power of two next to the lights' geometric mean of it: fluxes come in any unit.
[[nodiscard]] double FluxScale(const Lights& lights);

// Runs Touch over a whole image: what SolveLambertian would take if memory were the only cost.
[[nodiscard]] Status TouchAllRows(const FastRows& rows, ImageSize size, const Task& task,
                                  NormalField& field);

// Bytes that Solve and Touch read and write for each pixel.
[[nodiscard]] size_t BytesPerPixel(size_t light_count);

}  // namespace sateen
