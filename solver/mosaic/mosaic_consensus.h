#pragma once

#include <cstdint>
#include <span>

#include "imaging/mosaic_stack.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/kernels/mosaic_kernel.h"
#include "solver/mosaic/mosaic_piece.h"

namespace sateen {

// Rung 2 (solver/robust/consensus.h) for the sites of a mosaic: with a site's own colour or, where
// the samples agree far better, with the colours interpolated from its neighbours. Borrows its
// arguments for the time of one solve.
class MosaicConsensus {
 public:
  // `params`: those of the mosaic's kernel.
  MosaicConsensus(const MosaicStack& stack, const MosaicKernelParams& params);

  // Solves the sites that are listed by their index in `rows`, like FastRows::SolveConsensus.
  void Solve(const MosaicPiece& piece, std::span<const size_t> sites, SiteRows& rows,
             std::span<uint8_t> agreeing) const;

 private:
  struct Answers;

  // Returns i', without the light's geometry, in column x of the image's row y; NaN where
  // saturated.
  [[nodiscard]] float SampleAt(const MosaicPiece& piece, size_t frame, int x, int y) const;
  // Returns the same for any colour: that of other sites is the mean of the nearest ones.
  [[nodiscard]] float ColourAt(const MosaicPiece& piece, size_t frame, int x, int y,
                               size_t colour) const;
  [[nodiscard]] Answers Search(const MosaicPiece& piece, std::span<const size_t> sites,
                               bool coloured) const;

  const MosaicStack* stack_;
  const MosaicKernelParams* mosaic_;
  KernelParams params_;
};

}  // namespace sateen
