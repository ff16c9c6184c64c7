#include "solver/mosaic/mosaic_bands.h"

#include <atomic>
#include <vector>

#include "core/parallel.h"
#include "solver/kernels/mosaic_kernel.h"

namespace sateen {
namespace {

// Rows per thread and step. Each step reads one more row on either side, so few rows are read
// twice.
constexpr int kMosaicRowsPerPiece = 8;

}  // namespace

Status BandSolver::Solve(int begin, int end, NormalField& field, int field_row) {
  rows_.Begin(begin, end, field, field_row, job_.options.mode.has_value());
  PieceSummary ignored;
  below_.clear();
  const Status status = SolveRows(begin, end);
  if (status && end < job_.input.stack.size_px.height &&
      !SolveRowAlone(job_, end, ignored, below_)) {
    return tl::unexpected(CannotReadBack(job_.input.stack));
  }
  return status.and_then([&] { return InterpolateAlbedo(begin, end); });
}

Status BandSolver::SolveRows(int begin, int end) {
  std::vector<PieceSummary> pieces(static_cast<size_t>(end - begin));
  std::atomic<bool> is_read = true;
  Status status = ParallelFor(end - begin, kMosaicRowsPerPiece, task_, [&](int from, int to) {
    if (!SolvePiece(job_, begin + from, begin + to, rows_, pieces[static_cast<size_t>(from)])) {
      is_read = false;
    }
  });
  for (const PieceSummary& piece : pieces) {
    total_.Add(piece);  // in order
  }
  return status && !is_read ? tl::unexpected(CannotReadBack(job_.input.stack)) : status;
}

Status BandSolver::InterpolateAlbedo(int begin, int end) {
  const auto width = static_cast<size_t>(job_.input.stack.size_px.width);
  const auto own = [&](int row) -> const float* {
    const std::vector<float>& beyond = row < begin ? above_ : below_;
    if (row < begin || row >= end) {
      return beyond.empty() ? nullptr : beyond.data();
    }
    return &rows_.OwnColour(rows_.Index(row));
  };
  NormalField& field = rows_.Field();
  const Task silent{.threads = task_.threads, .progress = nullptr, .cancel = task_.cancel};
  Status status = ParallelFor(end - begin, kMosaicRowsPerPiece, silent, [&](int from, int to) {
    for (int row = begin + from; row < begin + to; ++row) {
      const size_t at = rows_.Index(row);
      InterpolateAlbedoRow(
          job_.input.stack.cfa, row, {own(row - 1), own(row), own(row + 1)}, width,
          {&field.albedo[0].pixels[at], &field.albedo[1].pixels[at], &field.albedo[2].pixels[at]});
    }
  });
  above_.assign(own(end - 1), own(end - 1) + width);
  return status;
}

}  // namespace sateen
