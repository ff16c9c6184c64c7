#include "solver/mosaic/mosaic_piece.h"

#include <utility>

namespace sateen {

void SiteRows::Begin(int begin, int end, NormalField& field, int field_row, bool with_ladder) {
  field_ = &field;
  field_row_ = field_row;
  first_ = Index(begin);
  own_colour_.resize(Index(end) - first_);
  misfit_.resize(with_ladder ? own_colour_.size() : 0);
}

MosaicPiece PiecePool::Take() {
  const std::lock_guard lock(mutex_);
  if (idle_.empty()) {
    return {};
  }
  MosaicPiece piece = std::move(idle_.back());
  idle_.pop_back();
  return piece;
}

void PiecePool::Give(MosaicPiece piece) {
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(piece));
}

}  // namespace sateen
