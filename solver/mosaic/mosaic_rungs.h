#pragma once

#include <array>
#include <optional>

#include "imaging/mosaic_stack.h"
#include "rig/rig.h"
#include "solver/light_doubt.h"
#include "solver/lobe/lobe.h"
#include "solver/mosaic/mosaic.h"
#include "solver/mosaic/mosaic_feed.h"
#include "solver/robust/rungs.h"

namespace sateen {

// One solve of a mosaic stack.
struct MosaicJob {
  const MosaicStack& stack;
  const Rig& rig;
  const Mask* mask;  // null: all
  const MosaicOptions& options;
  const MosaicFeed& feed;
  PiecePool& pieces;
  const std::array<float, 256>& limit;  // of the misfit, by usable readings
  const std::optional<LightDoubt>& light_doubt;
  Doubt doubt;
  std::optional<Lobe> lobe;
};

// All rungs for rows [begin, end), into `rows`. False where their readings cannot be read.
[[nodiscard]] bool SolvePiece(const MosaicJob& job, int begin, int end, SiteRows& rows,
                              PieceSummary& summary);

}  // namespace sateen
