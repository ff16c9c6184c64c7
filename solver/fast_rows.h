#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "rig/table_grid.h"
#include "solver/fast_kernel.h"
#include "solver/gain_rows.h"
#include "solver/lambertian.h"
#include "solver/noise.h"

namespace sateen {

// Feeds rows of a stack to the kernel. Borrows the stack and the mask, which must have been checked
// (SolveLambertian does).
class FastRows {
 public:
  // kBadData where a near light needs table positions and a pixel does not see the table.
  [[nodiscard]] static Result<FastRows> Make(const LightStack& stack, const Rig& rig,
                                             const std::optional<Mask>& mask,
                                             const LambertianOptions& options,
                                             const StackNoise* noise = nullptr);

  // Table positions and gains of some pixels, as far as the lights need them.
  struct Geometry {
    std::vector<float> x_mm;
    std::vector<float> y_mm;
    std::vector<float> gains;
    std::vector<const float*> places;  // of each light's gains, or null
  };
  // Of the pixels of rows [begin, end).
  [[nodiscard]] Geometry GeometryOf(int begin, int end) const;

  // Solves rows [begin, end) into `field`; refused pixels are kIllConditioned.
  void Solve(int begin, int end, NormalField& field) const;
  // With weights, for which there must be noise: also field.uncertainty, times noise_scale,
  // field.model and the misfit of each pixel.
  void SolveWeighted(int begin, int end, const Geometry& geometry, double noise_scale,
                     NormalField& field, std::span<float> misfits) const;
  // Misfit, usable samples and reason of pixels anywhere, in order of their indices.
  void MisfitsAt(std::span<const size_t> pixels, std::span<float> misfits,
                 std::span<uint8_t> samples, std::span<uint8_t> reasons) const;
  // Rung 2 for the pixels that are listed by index, of rows from `begin` on whose geometry this is,
  // into `field`. The others' content stays, and so does that of a listed pixel without an answer.
  // `agreeing`, of as many entries, receives how many samples agree, 0 without an answer.
  void SolveConsensus(int begin, const Geometry& geometry, std::span<const size_t> pixels,
                      NormalField& field, std::span<uint8_t> agreeing) const;
  // Reads and writes the same bytes and only adds them up: the floor of Solve.
  void Touch(int begin, int end, NormalField& field) const;

 private:
  using SpanFunction = void (*)(const KernelParams&, const KernelInput&, const KernelOutput&);

  // Samples and geometry of listed pixels side by side, so that every lane of a vector has work.
  struct Listed {
    std::vector<float> values;
    std::vector<const float*> planes;
    std::vector<const float*> gains;
    size_t count = 0;

    // Positions are zero where there are none.
    [[nodiscard]] KernelInput Input() const;
  };

  FastRows(const LightStack& stack, const std::optional<Mask>& mask)
      : stack_(&stack), mask_(&mask) {}
  void Run(SpanFunction function, int begin, int end, const Geometry& geometry, NormalField& field,
           float* misfits, double noise_scale = 1.0) const;
  [[nodiscard]] Listed MakeListed(std::span<const size_t> pixels) const;
  // Positions and gains of pixels[begin, end), whose geometry starts with pixel `first`.
  static void ListGeometry(const Geometry& geometry, size_t first, std::span<const size_t> pixels,
                           size_t begin, size_t end, Listed& listed);
  // 1 / g of rows [begin, end) for each light that has a field: `gains` holds them, `places` where.
  void FillGains(int begin, int end, std::vector<float>& gains,
                 std::vector<const float*>& places) const;

  const LightStack* stack_;
  const std::optional<Mask>* mask_;
  std::optional<TableGrid> grid_;  // absent where all lights are distant
  std::optional<GainRows> gains_;  // absent where no light has a field
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
