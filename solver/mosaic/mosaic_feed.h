#pragma once

#include <utility>
#include <vector>

#include "core/error.h"
#include "imaging/mosaic_stack.h"
#include "solver/kernels/mosaic_kernel.h"
#include "solver/lambertian.h"
#include "solver/least_squares/pixel_geometry.h"
#include "solver/mosaic/mosaic_piece.h"
#include "solver/solve_input.h"

namespace sateen {

// Returns the rows that are solved first to judge the whole: they lie evenly over the rows with a
// pixel inside the mask.
[[nodiscard]] std::vector<int> RowsLookedAt(const MosaicInput& input);

// Returns the error for readings that cannot be read.
[[nodiscard]] Error CannotReadBack(const MosaicStack& stack);

// Feeds rows of a mosaic stack to the kernels. Borrows the stack, which must have been checked, for
// the time of one solve.
class MosaicFeed {
 public:
  // Fails with kBadData where a near light needs table positions and a pixel does not see the
  // table.
  [[nodiscard]] static Result<MosaicFeed> Make(const MosaicInput& input,
                                               const LambertianOptions& options, bool weighted);

  // Reads rows into a piece, whose memory is used again: fresh pages took a fifth of a large solve.
  void Read(int begin, int end, MosaicPiece& piece) const;
  // Solves the piece's rows into those of `rows`. `mask` is that of the whole image, or null.
  void Solve(const MosaicPiece& piece, const Mask* mask, SiteRows& rows) const;
  [[nodiscard]] const MosaicKernelParams& Params() const { return params_; }

 private:
  using RowFunction = void (*)(const MosaicKernelParams&, const MosaicKernelInput&,
                               const MosaicKernelOutput&);

  MosaicFeed(const MosaicStack& stack, PixelLocator locator)
      : stack_(&stack), locator_(std::move(locator)) {}
  void ReadDark(MosaicPiece& piece) const;
  void Run(RowFunction function, const MosaicPiece& piece, const Mask* mask, SiteRows& rows) const;

  const MosaicStack* stack_;
  PixelLocator locator_;
  MosaicKernelParams params_;
};

}  // namespace sateen
