#pragma once

#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/error.h"
#include "imaging/mosaic_stack.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/kernels/mosaic_kernel.h"
#include "solver/lambertian.h"
#include "solver/least_squares/pixel_geometry.h"

namespace sateen {

// Where the answers of some rows go: maps of these or more rows, and what only the solve itself needs.
// Sites are named by their index in the maps.
class SiteRows {
 public:
  // For rows [begin, end) of an image; row 0 of `field` is the image's `field_row`.
  void Begin(int begin, int end, NormalField& field, int field_row, bool with_ladder);

  [[nodiscard]] NormalField& Field() const { return *field_; }
  [[nodiscard]] size_t Index(int row) const { return field_->reason.Index(0, row - field_row_); }
  // Albedo of a site's own colour.
  [[nodiscard]] float& OwnColour(size_t site) { return own_colour_[site - first_]; }
  [[nodiscard]] float& Misfit(size_t site) { return misfit_[site - first_]; }

 private:
  NormalField* field_ = nullptr;
  int field_row_ = 0;
  size_t first_ = 0;  // site
  std::vector<float> own_colour_;
  std::vector<float> misfit_;
};

// What the kernels need of rows [begin, end): readings and dark frame, of a row more on either side, and
// geometry. Sites are counted from the first of row `begin`.
class MosaicPiece {
 public:
  [[nodiscard]] bool IsRead() const { return is_read_; }
  [[nodiscard]] int Begin() const { return begin_; }
  [[nodiscard]] int End() const { return end_; }
  [[nodiscard]] uint16_t Reading(size_t frame, size_t site) const {
    return readings_[frame][beyond_ + site];
  }
  [[nodiscard]] float Dark(size_t site) const {
    return dark_.empty() ? 0.0F : dark_[beyond_ + site];
  }

 private:
  friend class MosaicFeed;

  bool is_read_ = true;
  int begin_ = 0;
  int end_ = 0;
  int read_begin_ = 0;  // with the rows beyond
  int read_end_ = 0;
  size_t beyond_ = 0;  // sites before row `begin`
  std::vector<std::vector<uint16_t>> buffers_;
  std::vector<const uint16_t*> readings_;  // of each lit frame
  std::vector<float> dark_;
  PixelGeometry geometry_;
};

// Pieces that are not in use. Calls may come from any thread.
class PiecePool {
 public:
  [[nodiscard]] MosaicPiece Take();
  void Give(MosaicPiece piece);

 private:
  std::mutex mutex_;
  std::vector<MosaicPiece> idle_;
};

// Rows that are solved first of all, for what they tell of the whole: they lie evenly over those with a
// pixel inside the mask, of the whole image or null.
[[nodiscard]] std::vector<int> RowsLookedAt(const MosaicStack& stack, const Mask* mask);

[[nodiscard]] Error CannotReadBack(const MosaicStack& stack);

// Feeds rows of a mosaic stack, which it borrows and which must have been checked, to the kernels.
class MosaicFeed {
 public:
  // kBadData where a near light needs table positions and a pixel does not see the table.
  [[nodiscard]] static Result<MosaicFeed> Make(const MosaicStack& stack, const Rig& rig,
                                               const LambertianOptions& options, bool weighted);

  // Into a piece whose memory is used again: fresh pages for each took a fifth of a large solve.
  void Read(int begin, int end, MosaicPiece& piece) const;
  // Into the rows of `rows` that are the piece's; `mask` of the whole image or null.
  void Solve(const MosaicPiece& piece, const Mask* mask, SiteRows& rows) const;
  // Rung 2 for the sites listed by their index in `rows`, as FastRows::SolveConsensus: with the site's
  // own colour, or, where samples agree far better, with the colours interpolated from its neighbours.
  void SolveConsensus(const MosaicPiece& piece, std::span<const size_t> sites, SiteRows& rows,
                      std::span<uint8_t> agreeing) const;
  // Reads and writes the same bytes and only adds them up: the floor of Solve.
  void Touch(const MosaicPiece& piece, SiteRows& rows) const;

 private:
  using RowFunction = void (*)(const MosaicKernelParams&, const MosaicKernelInput&,
                               const MosaicKernelOutput&);

  struct Consensus;

  // i' but for the light's geometry, of the site in column x of the image's row y; NaN where it is
  // saturated. `colour` of another site is the mean of the nearest ones.
  [[nodiscard]] float SampleAt(const MosaicPiece& piece, size_t frame, int x, int y) const;
  [[nodiscard]] float ColourAt(const MosaicPiece& piece, size_t frame, int x, int y,
                               size_t colour) const;
  [[nodiscard]] Consensus Search(const MosaicPiece& piece, std::span<const size_t> sites,
                                 bool coloured) const;
  MosaicFeed(const MosaicStack& stack, PixelLocator locator)
      : stack_(&stack), locator_(std::move(locator)) {}
  void ReadDark(MosaicPiece& piece) const;
  void Run(RowFunction function, const MosaicPiece& piece, const Mask* mask, SiteRows& rows) const;

  const MosaicStack* stack_;
  PixelLocator locator_;
  MosaicKernelParams params_;
  KernelParams consensus_;
};

}  // namespace sateen
