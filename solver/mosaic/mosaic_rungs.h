#pragma once

#include <array>
#include <optional>
#include <vector>

#include "solver/light_doubt.h"
#include "solver/lobe/lobe.h"
#include "solver/mosaic/mosaic.h"
#include "solver/mosaic/mosaic_consensus.h"
#include "solver/mosaic/mosaic_feed.h"
#include "solver/robust/rungs.h"
#include "solver/solve_input.h"

namespace sateen {

// One solve of a mosaic stack. Borrows its parts for the time of it.
struct MosaicJob {
  MosaicInput input;
  const MosaicOptions& options;
  const MosaicFeed& feed;
  const MosaicConsensus& consensus;
  PiecePool& pieces;
  const std::array<float, 256>& limit;  // largest explained misfit, by usable readings
  const std::optional<LightDoubt>& light_doubt;
  Doubt doubt;
  std::optional<Lobe> lobe;
};

// Solves rows [begin, end) on all rungs into `rows`. Returns false where their readings cannot be
// read.
[[nodiscard]] bool SolvePiece(const MosaicJob& job, int begin, int end, SiteRows& rows,
                              PieceSummary& summary);

// Solves a row by itself: adds to the summary, and returns the albedo of its sites' own colours in
// `own`. Returns false where its readings cannot be read.
[[nodiscard]] bool SolveRowAlone(const MosaicJob& job, int row, PieceSummary& summary,
                                 std::vector<float>& own);

}  // namespace sateen
