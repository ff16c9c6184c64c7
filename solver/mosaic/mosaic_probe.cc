#include "solver/mosaic/mosaic_probe.h"

#include <algorithm>
#include <atomic>
#include <utility>
#include <vector>

#include "core/parallel.h"
#include "solver/lobe/lobe.h"
#include "solver/lobe/lobe_search.h"
#include "solver/mosaic/mosaic_site.h"

namespace sateen {
namespace {

// Solves some rows and judges the scene by them.
class Probe {
 public:
  explicit Probe(MosaicJob& job) : job_(job), places_(RowsLookedAt(job.input)) {}

  Status Run(const Task& task) {
    const Task silent{.threads = task.threads, .progress = nullptr, .cancel = task.cancel};
    Status status = SolveRows(silent);
    // One colour's noise hides more of a lobe than three colours' noise does, so a few sites that
    // climb are reason enough to search.
    if (status && job_.input.rig.camera && !DoubtOf(total_).IsNone()) {
      job_.lobe = FindLobeOfSites(task.ThreadCount());
      status = job_.lobe ? SolveRows(silent) : status;
    }
    job_.doubt = DoubtOf(total_);
    return status;
  }

 private:
  Status SolveRows(const Task& task) {
    std::vector<PieceSummary> pieces(places_.size());
    std::atomic<bool> is_read = true;
    const Status status =
        ParallelFor(static_cast<int>(places_.size()), 1, task, [&](int probe, int) {
          const auto at = static_cast<size_t>(probe);
          std::vector<float> own;
          if (!SolveRowAlone(job_, places_[at], pieces[at], own)) {
            is_read = false;
          }
        });
    total_ = {};
    for (const PieceSummary& piece : pieces) {
      total_.Add(piece);
    }
    return status && !is_read ? tl::unexpected(CannotReadBack(job_.input.stack)) : status;
  }

  [[nodiscard]] std::optional<Lobe> FindLobeOfSites(int threads) const {
    MosaicSite site(job_.input, job_.options.least_squares, true);
    const int width = job_.input.stack.size_px.width;
    std::vector<LobeSamples> samples;
    const int columns = static_cast<int>(kLobePixels / places_.size()) + 1;
    for (const int row : places_) {
      MosaicPiece piece;
      job_.feed.Read(row, row + 1, piece);
      for (int j = 0; j < columns && piece.IsRead(); ++j) {
        // Takes both colours of the row in turn.
        const int column = std::min(width - 1, (2 * j + 1) * width / (2 * columns) / 2 * 2 + j % 2);
        const bool is_inside = job_.input.mask == nullptr || job_.input.mask->At(column, row) != 0;
        const std::optional<Eigen::Vector3d> v =
            is_inside ? ViewOf(job_.input.rig, column, row) : std::nullopt;
        std::optional<LobeSamples> of_site =
            v ? site.LobeSamplesAt(column, row, piece, *v, job_.limit) : std::nullopt;
        if (of_site && of_site->l.rows() >= kFewestForLobe) {
          samples.push_back(*std::move(of_site));
        }
      }
    }
    return SearchLobe(samples, threads);
  }

  MosaicJob& job_;
  std::vector<int> places_;
  PieceSummary total_;
};

}  // namespace

Status ProbeMosaic(MosaicJob& job, const Task& task) { return Probe(job).Run(task); }

}  // namespace sateen
