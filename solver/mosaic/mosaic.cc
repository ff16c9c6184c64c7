#include "solver/mosaic/mosaic.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <future>
#include <utility>
#include <vector>

#include "core/parallel.h"
#include "solver/least_squares/fast_rows.h"
#include "solver/lobe/lobe.h"
#include "solver/lobe/lobe_search.h"
#include "solver/mosaic/mosaic_feed.h"
#include "solver/mosaic/mosaic_noise.h"
#include "solver/mosaic/mosaic_rungs.h"
#include "solver/mosaic/mosaic_site.h"
#include "solver/robust/rungs.h"

namespace sateen {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kFewestLights = 3;
// Of a thread at a time: with the row more that is read on either side, few rows would be read twice.
constexpr int kMosaicRowsPerPiece = 8;

double SecondsFrom(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void ResizeMaps(ImageSize size, bool with_ladder, NormalField& field) {
  field.Resize(size);
  const ImageSize ladder_size = with_ladder ? size : ImageSize{};
  if (field.model.Size() != ladder_size || field.albedo_uncertainty.Size() != ladder_size) {
    field.uncertainty = Image<float>(ladder_size);
    field.albedo_uncertainty = Image<float>(ladder_size);
    field.model = Image<uint8_t>(ladder_size);
  }
}

Status CheckMosaics(const MosaicStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                    const LambertianOptions& options) {
  const ImageSize size = stack.size_px;
  if (stack.lit.size() != rig.lights.size()) {
    return Fail(ErrorCode::kBadData, "{} frames but {} lights; need one light a frame",
                stack.lit.size(), rig.lights.size());
  }
  if (stack.lit.size() < kFewestLights) {
    return Fail(ErrorCode::kDegenerate, "{} lights; need at least {} to solve for a normal",
                stack.lit.size(), kFewestLights);
  }
  if (size.width < static_cast<int>(kFewestSites) || size.height < 2) {
    return Fail(ErrorCode::kBadData, "the mosaics are {}x{} sites; need at least {}x2", size.width,
                size.height, kFewestSites);
  }
  if (mask && mask->Size() != size) {
    return Fail(ErrorCode::kBadData, "the mask is {}x{} px but the frames are {}x{} px",
                mask->width, mask->height, size.width, size.height);
  }
  if (Status status =
          rig.Validate("rig").and_then([&] { return CheckHeight(options.height_mm, rig, size); });
      !status || AllDistant(rig.lights)) {
    return status;
  }
  if (rig.camera->size_px != size) {
    return Fail(ErrorCode::kBadData, "the rig's camera has {}x{} px but the frames are {}x{} px",
                rig.camera->size_px.width, rig.camera->size_px.height, size.width, size.height);
  }
  return {};
}

bool IsNoiseKnown(const MosaicStack& stack) {
  return std::ranges::all_of(stack.lit, [](const MosaicFrame& frame) {
    return frame.gain_dn > 0.0 || frame.read_dn > 0.0;
  });
}

// Rows [begin, end) on all threads, their sums in order.
Status SolveRowsOfMosaic(const MosaicJob& job, int begin, int end, const Task& task, SiteRows& rows,
                         PieceSummary& total) {
  std::vector<PieceSummary> pieces(static_cast<size_t>(end - begin));
  std::atomic<bool> is_read = true;
  Status status = ParallelFor(end - begin, kMosaicRowsPerPiece, task, [&](int from, int to) {
    if (!SolvePiece(job, begin + from, begin + to, rows, pieces[static_cast<size_t>(from)])) {
      is_read = false;
    }
  });
  for (const PieceSummary& piece : pieces) {
    total.Add(piece);
  }
  return status && !is_read ? tl::unexpected(CannotReadBack(job.stack)) : status;
}

// A row by itself: totals, and the albedo of its sites' own colours. False where it cannot be read.
bool SolveRowAlone(const MosaicJob& job, int row, PieceSummary& summary, std::vector<float>& own) {
  NormalField field;
  SiteRows rows;
  ResizeMaps({job.stack.size_px.width, 1}, job.options.mode.has_value(), field);
  rows.Begin(row, row + 1, field, row, job.options.mode.has_value());
  if (!SolvePiece(job, row, row + 1, rows, summary)) {
    return false;
  }
  own.assign(&rows.OwnColour(0), &rows.OwnColour(0) + job.stack.size_px.width);
  return true;
}

// What some rows tell before the others are solved: whether the scene has a lobe, and how far rung 1 is
// to be doubted in what noise hides.
class Probe {
 public:
  explicit Probe(MosaicJob& job) : job_(job), places_(RowsLookedAt(job.stack, job.mask)) {}

  Status Run(const Task& task) {
    const Task silent{.threads = task.threads, .progress = nullptr, .cancel = task.cancel};
    Status status = SolveRows(silent);
    // One colour's noise hides more of a lobe than three colours' does, so that already a few sites
    // that climb are a reason to look.
    if (status && job_.rig.camera && !DoubtOf(total_).IsNone()) {
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
    return status && !is_read ? tl::unexpected(CannotReadBack(job_.stack)) : status;
  }

  [[nodiscard]] std::optional<Lobe> FindLobeOfSites(int threads) const {
    MosaicSite site(job_.stack, job_.rig, job_.options.least_squares, true);
    std::vector<LobeSamples> samples;
    const int columns = static_cast<int>(kLobePixels / places_.size()) + 1;
    for (const int row : places_) {
      MosaicPiece piece;
      job_.feed.Read(row, row + 1, piece);
      for (int j = 0; j < columns && piece.IsRead(); ++j) {
        // Of both colours of the row, one after the other.
        const int column =
            std::min(job_.stack.size_px.width - 1,
                     (2 * j + 1) * job_.stack.size_px.width / (2 * columns) / 2 * 2 + j % 2);
        const bool is_inside = job_.mask == nullptr || job_.mask->At(column, row) != 0;
        const std::optional<Eigen::Vector3d> v =
            is_inside ? ViewOf(job_.rig, column, row) : std::nullopt;
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

SolveSummary SummaryOf(const PieceSummary& total, const MosaicJob& job, bool is_noise_known,
                       const Task& task, double seconds) {
  SolveSummary summary = total.counts;
  summary.pixels = summary.solved + summary.dark + summary.too_few_samples + summary.saturated +
                   summary.ill_conditioned;
  summary.seconds = seconds;
  summary.threads = task.ThreadCount();
  if (job.options.mode) {
    ReportRungs(total, summary);
    summary.noise_known = is_noise_known;
    const double gain = job.stack.lit[0].gain_dn;
    summary.noise_scale = is_noise_known ? 1.0 : gain < kUnknownGain ? std::sqrt(gain) : 0.0;
  }
  summary.lobe = job.lobe;
  summary.backend = job.options.least_squares.backend;
  if (summary.backend == Backend::kFast || summary.backend == Backend::kAuto) {
    summary.instruction_set = KernelInstructionSet();
  }
  return summary;
}

// One band after the other into maps, their own or those of the whole image.
class BandSolver {
 public:
  BandSolver(const MosaicJob& job, const Task& task) : job_(job), task_(task) {}

  // Rows [begin, end), which follow those of the call before; row 0 of `field` is `field_row`.
  Status Solve(int begin, int end, NormalField& field, int field_row) {
    rows_.Begin(begin, end, field, field_row, job_.options.mode.has_value());
    PieceSummary ignored;
    below_.clear();
    const Status status = SolveRowsOfMosaic(job_, begin, end, task_, rows_, total_);
    if (status && end < job_.stack.size_px.height && !SolveRowAlone(job_, end, ignored, below_)) {
      return tl::unexpected(CannotReadBack(job_.stack));
    }
    return status.and_then([&] { return InterpolateAlbedo(begin, end); });
  }
  [[nodiscard]] const PieceSummary& Total() const { return total_; }

 private:
  Status InterpolateAlbedo(int begin, int end) {
    const auto width = static_cast<size_t>(job_.stack.size_px.width);
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
        InterpolateAlbedoRow(job_.stack.cfa, row, {own(row - 1), own(row), own(row + 1)}, width,
                             {&field.albedo[0].pixels[at], &field.albedo[1].pixels[at],
                              &field.albedo[2].pixels[at]});
      }
    });
    above_.assign(own(end - 1), own(end - 1) + width);
    return status;
  }

  const MosaicJob& job_;
  const Task& task_;
  SiteRows rows_;
  PieceSummary total_;
  // Own colours just beyond the band; empty at the image's border.
  std::vector<float> above_;
  std::vector<float> below_;
};

Status MeasureNoiseInto(const Rig& rig, const std::optional<Mask>& mask,
                        const MosaicOptions& options, const Task& task, MosaicStack& stack) {
  const Result<double> gain = MeasureGain(stack, rig, mask, options.least_squares, task);
  if (!gain) {
    return tl::unexpected(gain.error());
  }
  for (MosaicFrame& frame : stack.lit) {
    frame.gain_dn = *gain;
    frame.read_dn = kRoundingDn;
  }
  return {};
}

// What all solves have in common: `solve_bands` hands every band to the solver, in order.
Result<SolveSummary> SolveBandsBy(const MosaicStack& stack, const Rig& rig,
                                  const std::optional<Mask>& mask, const MosaicOptions& options,
                                  const Task& task,
                                  const std::function<Status(BandSolver&)>& solve_bands) {
  const Clock::time_point start = Clock::now();
  if (const Status status = options.Validate().and_then(
          [&] { return CheckMosaics(stack, rig, mask, options.least_squares); });
      !status) {
    return tl::unexpected(status.error());
  }
  MosaicStack weighed = stack;
  const bool is_known = IsNoiseKnown(stack);
  if (options.mode && !is_known) {
    const Status measured = MeasureNoiseInto(rig, mask, options, task, weighed);
    if (!measured) {
      return tl::unexpected(measured.error());
    }
  }
  const Result<MosaicFeed> feed =
      MosaicFeed::Make(weighed, rig, options.least_squares, options.mode.has_value());
  if (!feed) {
    return tl::unexpected(feed.error());
  }
  const std::array<float, 256> limit = MisfitLimits(1.0, options.false_alarms);
  const std::optional<LightDoubt> light_doubt = LightDoubt::Make(rig, stack.size_px);
  PiecePool pieces;
  MosaicJob job{weighed, rig, mask ? &*mask : nullptr, options, *feed, pieces, limit, light_doubt,
                {},      {}};
  if (const Status probed = options.mode == LadderMode::kAuto ? Probe(job).Run(task) : Status();
      !probed) {
    return tl::unexpected(probed.error());
  }
  task.BeginStage("solving", stack.size_px.height);
  BandSolver solver(job, task);
  return solve_bands(solver).map(
      [&] { return SummaryOf(solver.Total(), job, is_known, task, SecondsFrom(start)); });
}

}  // namespace

Status MosaicOptions::Validate() const {
  if (band_rows < 1) {
    return Fail(ErrorCode::kInvalidArgument, "band_rows = {}; need at least 1", band_rows);
  }
  const LadderOptions ladder{.least_squares = least_squares,
                             .false_alarms = false_alarms,
                             .explained_residual = explained_residual};
  return ladder.Validate();
}

Result<SolveSummary> SolveMosaicByBands(const MosaicStack& stack, const Rig& rig,
                                        const std::optional<Mask>& mask,
                                        const MosaicOptions& options, const Task& task,
                                        const BandSink& sink) {
  return SolveBandsBy(stack, rig, mask, options, task, [&](BandSolver& solver) {
    const int height = stack.size_px.height;
    std::array<NormalField, 2> maps;  // one is handed on while the other is solved
    std::future<Status> handed_on;
    Status status;
    for (int begin = 0, k = 0; status && begin < height; begin += options.band_rows, ++k) {
      NormalField& field = maps[static_cast<size_t>(k % 2)];
      const int end = std::min(begin + options.band_rows, height);
      ResizeMaps({stack.size_px.width, end - begin}, options.mode.has_value(), field);
      status = solver.Solve(begin, end, field, begin);
      const Status before = handed_on.valid() ? handed_on.get() : Status();
      status = before ? status : before;
      if (status) {
        handed_on =
            std::async(std::launch::async, [&sink, &field, begin] { return sink(begin, field); });
      }
    }
    const Status last = handed_on.valid() ? handed_on.get() : Status();
    return status ? last : status;
  });
}

Status SolveMosaicInto(const MosaicStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                       const MosaicOptions& options, const Task& task, NormalField& field) {
  return SolveBandsBy(stack, rig, mask, options, task,
                      [&](BandSolver& solver) {
                        const int height = stack.size_px.height;
                        ResizeMaps(stack.size_px, options.mode.has_value(), field);
                        Status status;
                        for (int begin = 0; status && begin < height; begin += options.band_rows) {
                          const int end = std::min(begin + options.band_rows, height);
                          status = solver.Solve(begin, end, field, 0);
                        }
                        return status;
                      })
      .map([&](const SolveSummary& summary) { field.summary = summary; });
}

Result<NormalField> SolveMosaic(const MosaicStack& stack, const Rig& rig,
                                const std::optional<Mask>& mask, const MosaicOptions& options,
                                const Task& task) {
  NormalField field;
  return SolveMosaicInto(stack, rig, mask, options, task, field).map([&] {
    return std::move(field);
  });
}

}  // namespace sateen
