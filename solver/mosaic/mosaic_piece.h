#pragma once

#include <cstdint>
#include <mutex>
#include <vector>

#include "solver/least_squares/pixel_geometry.h"
#include "solver/normal_field.h"

namespace sateen {

// Answers for some rows: maps of these or more rows, borrowed, and values that only the solve
// itself needs. A site is given by its index in the maps.
class SiteRows {
 public:
  // Starts rows [begin, end) of an image. Row 0 of `field` is the image's `field_row`.
  void Begin(int begin, int end, NormalField& field, int field_row, bool with_ladder);

  [[nodiscard]] NormalField& Field() const { return *field_; }
  [[nodiscard]] size_t Index(int row) const { return field_->reason.Index(0, row - field_row_); }
  // Returns the albedo of a site's own colour.
  [[nodiscard]] float& OwnColour(size_t site) { return own_colour_[site - first_]; }
  [[nodiscard]] float& Misfit(size_t site) { return misfit_[site - first_]; }

 private:
  NormalField* field_ = nullptr;
  int field_row_ = 0;
  size_t first_ = 0;  // site
  std::vector<float> own_colour_;
  std::vector<float> misfit_;
};

// Input of the kernels for rows [begin, end): geometry, and readings and dark frame with one more
// row on either side. Sites are counted from the first of row `begin`.
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
  // Rows that were read, with those beyond.
  [[nodiscard]] int ReadBegin() const { return read_begin_; }
  [[nodiscard]] int ReadEnd() const { return read_end_; }
  // Returns a reading and the dark frame in column x of the image's row y, which must have been
  // read.
  [[nodiscard]] uint16_t ReadingAt(size_t frame, int x, int y) const {
    return readings_[frame][ReadIndex(x, y)];
  }
  [[nodiscard]] float DarkAt(int x, int y) const {
    return dark_.empty() ? 0.0F : dark_[ReadIndex(x, y)];
  }
  [[nodiscard]] const PixelGeometry& Geometry() const { return geometry_; }

 private:
  friend class MosaicFeed;

  [[nodiscard]] size_t ReadIndex(int x, int y) const {
    return width_ * static_cast<size_t>(y - read_begin_) + static_cast<size_t>(x);
  }

  bool is_read_ = true;
  size_t width_ = 0;
  int begin_ = 0;
  int end_ = 0;
  int read_begin_ = 0;  // with the rows beyond
  int read_end_ = 0;
  size_t beyond_ = 0;  // sites before row `begin`
  std::vector<std::vector<uint16_t>> buffers_;
  std::vector<const uint16_t*> readings_;  // per lit frame
  std::vector<float> dark_;
  PixelGeometry geometry_;
};

// Pieces that are not in use. May be called from any thread.
class PiecePool {
 public:
  [[nodiscard]] MosaicPiece Take();
  void Give(MosaicPiece piece);

 private:
  std::mutex mutex_;
  std::vector<MosaicPiece> idle_;
};

}  // namespace sateen
