#pragma once

#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "solver/mosaic/mosaic_rungs.h"

namespace sateen {

// Solves one band after the other into maps, either of their own or of the whole image.
class BandSolver {
 public:
  BandSolver(const MosaicJob& job, const Task& task) : job_(job), task_(task) {}

  // Solves rows [begin, end), which follow those of the call before. Row 0 of `field` is the
  // image's `field_row`. Fails with kIo where rows cannot be read, or with kCancelled.
  [[nodiscard]] Status Solve(int begin, int end, NormalField& field, int field_row);
  [[nodiscard]] const PieceSummary& Total() const { return total_; }

 private:
  [[nodiscard]] Status SolveRows(int begin, int end);
  // Writes (5) of solver/mosaic/mosaic.h.
  [[nodiscard]] Status InterpolateAlbedo(int begin, int end);

  const MosaicJob& job_;
  const Task& task_;
  SiteRows rows_;
  PieceSummary total_;
  // Own colours just beyond the band; empty at the image's border.
  std::vector<float> above_;
  std::vector<float> below_;
};

}  // namespace sateen
