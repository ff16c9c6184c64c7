#include "solver/mosaic.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <limits>
#include <mutex>
#include <utility>

#include "core/angle.h"
#include "core/parallel.h"
#include "solver/consensus.h"
#include "solver/fast_rows.h"
#include "solver/mosaic_albedo.h"
#include "solver/mosaic_feed.h"
#include "solver/mosaic_site.h"

namespace sateen {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kMinLights = 3;
// Rows that are solved first of all, to see whether the model holds: they lie evenly over the image.
constexpr int kProbes = 32;
// As in the ladder of solver/ladder.h.
constexpr float kUnexplainedFactor = 3.0F;
constexpr double kDoubtfulShare = 0.2;

double SecondsFrom(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// One solve.
struct MosaicJob {
  const MosaicStack& stack;
  const Rig& rig;
  const Mask* mask;  // null: all
  const MosaicOptions& options;
  const MosaicFeed& feed;
  std::array<float, 256> limit = {};  // of the misfit, by usable readings
  bool doubt = false;                 // the model is wrong for many sites
};

struct RowTotals {
  SolveSummary counts;
  double least_squares_deg = 0.0;  // sums
  double robust_deg = 0.0;
  double turned_deg = 0.0;
};

Status CheckMosaics(const MosaicStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                    const MosaicOptions& options) {
  const ImageSize size = stack.size_px;
  if (stack.lit.size() != rig.lights.size()) {
    return Fail(ErrorCode::kBadData, "{} frames but {} lights; need one light a frame",
                stack.lit.size(), rig.lights.size());
  }
  if (stack.lit.size() < kMinLights) {
    return Fail(ErrorCode::kDegenerate, "{} lights; need at least {} to solve for a normal",
                stack.lit.size(), kMinLights);
  }
  if (size.width < static_cast<int>(kFewestSites) || size.height < 2) {
    return Fail(ErrorCode::kBadData, "the mosaics are {}x{} sites; need at least {}x2", size.width,
                size.height, kFewestSites);
  }
  if (mask && mask->Size() != size) {
    return Fail(ErrorCode::kBadData, "the mask is {}x{} px but the frames are {}x{} px",
                mask->width, mask->height, size.width, size.height);
  }
  for (const MosaicFrame& frame : stack.lit) {
    if (options.mode && !(frame.gain_dn > 0.0 || frame.read_dn > 0.0)) {
      return Fail(ErrorCode::kBadData,
                  "{}: its noise is not known, by which mosaics are weighted; need the sensor's gain "
                  "and read noise in the rig (sateen calibrate response), or solve without weights, "
                  "or from interpolated colours",
                  frame.name);
    }
  }
  if (Status status = rig.Validate("rig"); !status || AllDistant(rig.lights)) {
    return status;
  }
  if (rig.camera->size_px != size) {
    return Fail(ErrorCode::kBadData, "the rig's camera has {}x{} px but the frames are {}x{} px",
                rig.camera->size_px.width, rig.camera->size_px.height, size.width, size.height);
  }
  return {};
}

// Sites that the kernel refused, or all, one by one in double.
int64_t SolveInDouble(const MosaicJob& job, const MosaicPiece& piece, bool all, SiteRows& rows) {
  MosaicSite site(job.stack, job.rig, job.options.least_squares, job.options.mode.has_value());
  const auto width = static_cast<size_t>(job.stack.size_px.width);
  std::vector<uint16_t> readings(job.stack.lit.size());
  int64_t solved = 0;
  NormalField& field = rows.field;
  for (int row = piece.Begin(); row < piece.End(); ++row) {
    for (int column = 0; column < job.stack.size_px.width; ++column) {
      const size_t p = field.reason.Index(column, row - rows.first_row);
      const bool inside = job.mask == nullptr || job.mask->At(column, row) != 0;
      if (!inside || !(all || field.reason.pixels[p] ==
                                  static_cast<uint8_t>(Reason::kIllConditioned))) {
        continue;
      }
      const size_t at =
          static_cast<size_t>(row - piece.Begin()) * width + static_cast<size_t>(column);
      for (size_t k = 0; k < readings.size(); ++k) {
        readings[k] = piece.Reading(k, at);
      }
      const SiteSolution solution = site.Solve(column, row, readings, piece.Dark(at));
      const bool has_answer = solution.reason == Reason::kSolved;
      const double length = has_answer ? solution.n.norm() : 1.0;
      for (size_t c = 0; c < 3; ++c) {
        field.normal[c].pixels[p] =
            static_cast<float>(solution.n[static_cast<Eigen::Index>(c)] / length);
      }
      rows.own_colour.pixels[p] = has_answer ? static_cast<float>(length) : 0.0F;
      field.residual.pixels[p] = static_cast<float>(solution.residual);
      field.samples.pixels[p] = static_cast<uint8_t>(std::min(solution.samples, 255));
      field.reason.pixels[p] = static_cast<uint8_t>(solution.reason);
      if (job.options.mode) {
        field.uncertainty.pixels[p] = static_cast<float>(std::min(solution.uncertainty_deg, 180.0));
        rows.misfit.pixels[p] = static_cast<float>(solution.misfit);
      }
      ++solved;
    }
  }
  return solved;
}

bool MustClimb(const MosaicJob& job, const SiteRows& rows, size_t p) {
  const uint8_t samples = rows.field.samples.pixels[p];
  if (samples <= 3 || *job.options.mode == LadderMode::kLeastSquares) {
    return false;
  }
  if (*job.options.mode == LadderMode::kConsensus) {
    return true;
  }
  return rows.misfit.pixels[p] > job.limit[samples] &&
         rows.field.residual.pixels[p] >
             static_cast<float>(job.options.explained_residual) * rows.own_colour.pixels[p];
}

Eigen::Vector3f SiteNormal(const NormalField& field, size_t p) {
  return {field.normal[0].pixels[p], field.normal[1].pixels[p], field.normal[2].pixels[p]};
}

void ClimbSites(const MosaicJob& job, const MosaicPiece& piece, std::span<const size_t> sites,
                SiteRows& rows, RowTotals& totals) {
  std::vector<Eigen::Vector3f> before;
  before.reserve(sites.size());
  for (const size_t p : sites) {
    before.push_back(SiteNormal(rows.field, p));
  }
  std::vector<uint8_t> agreeing(sites.size());
  job.feed.SolveConsensus(piece, sites, rows, agreeing);
  for (size_t j = 0; j < sites.size(); ++j) {
    const bool is_explained = agreeing[j] >= kFewestAgreeing;
    float& uncertainty = rows.field.uncertainty.pixels[sites[j]];
    if (!is_explained) {
      uncertainty = std::min(180.0F, uncertainty * kUnexplainedFactor);
      ++totals.counts.unexplained;
    }
    rows.field.model.pixels[sites[j]] =
        static_cast<uint8_t>(is_explained ? Rung::kConsensus : Rung::kUnexplained);
    const Eigen::Vector3f after = SiteNormal(rows.field, sites[j]);
    totals.turned_deg += std::atan2(static_cast<double>(before[j].cross(after).norm()),
                                    static_cast<double>(before[j].dot(after))) *
                         kDegPerRad;
    totals.robust_deg += static_cast<double>(uncertainty);
  }
  totals.counts.robust.pixels += static_cast<int64_t>(sites.size());
}

// Rung 1's word on the piece's sites, then rung 2's on those that climb.
void Climb(const MosaicJob& job, const MosaicPiece& piece, SiteRows& rows, RowTotals& totals) {
  NormalField& field = rows.field;
  std::vector<size_t> sites;
  const size_t end = field.reason.Index(0, piece.End() - rows.first_row);
  for (size_t p = field.reason.Index(0, piece.Begin() - rows.first_row); p < end; ++p) {
    if (!IsSolved(field, p)) {
      field.model.pixels[p] = static_cast<uint8_t>(Rung::kNone);
      field.uncertainty.pixels[p] = 0.0F;
      continue;
    }
    const bool is_unchecked = field.samples.pixels[p] <= 3;
    field.model.pixels[p] =
        static_cast<uint8_t>(is_unchecked ? Rung::kUnchecked : Rung::kLeastSquares);
    if (MustClimb(job, rows, p)) {
      sites.push_back(p);
      continue;
    }
    float& uncertainty = field.uncertainty.pixels[p];
    uncertainty = std::min(
        180.0F, job.doubt ? std::hypot(uncertainty, kLeastModelUncertaintyDeg) : uncertainty);
    totals.least_squares_deg += static_cast<double>(uncertainty);
    ++totals.counts.least_squares.pixels;
    totals.counts.unchecked += is_unchecked ? 1 : 0;
  }
  if (!sites.empty()) {
    ClimbSites(job, piece, sites, rows, totals);
  }
}

void CountSites(const MosaicPiece& piece, const SiteRows& rows, SolveSummary& counts) {
  const size_t end = rows.field.reason.Index(0, piece.End() - rows.first_row);
  std::array<int64_t, 256> of = {};
  for (size_t p = rows.field.reason.Index(0, piece.Begin() - rows.first_row); p < end; ++p) {
    ++of[rows.field.reason.pixels[p]];
  }
  const auto count = [&](Reason reason) { return of[static_cast<size_t>(reason)]; };
  counts.solved += count(Reason::kSolved);
  counts.dark += count(Reason::kDark);
  counts.too_few_samples += count(Reason::kTooFewSamples);
  counts.saturated += count(Reason::kSaturated);
  counts.ill_conditioned += count(Reason::kIllConditioned);
}

// False where the rows cannot be read.
bool SolvePiece(const MosaicJob& job, int begin, int end, SiteRows& rows, RowTotals& totals) {
  const MosaicPiece piece = job.feed.Read(begin, end);
  if (!piece.IsRead()) {
    return false;
  }
  const Backend backend = job.options.least_squares.backend;
  const bool in_double = backend != Backend::kFast && backend != Backend::kAuto;
  job.feed.Solve(piece, job.mask, rows);
  if (backend != Backend::kFast) {
    const int64_t solved = SolveInDouble(job, piece, in_double, rows);
    totals.counts.resolved_by_reference += in_double ? 0 : solved;
  }
  if (job.options.mode) {
    Climb(job, piece, rows, totals);
  }
  CountSites(piece, rows, totals.counts);
  return true;
}

void AddTotals(const RowTotals& piece, RowTotals& total) {
  SolveSummary& sum = total.counts;
  const SolveSummary& of = piece.counts;
  sum.solved += of.solved;
  sum.dark += of.dark;
  sum.too_few_samples += of.too_few_samples;
  sum.saturated += of.saturated;
  sum.ill_conditioned += of.ill_conditioned;
  sum.resolved_by_reference += of.resolved_by_reference;
  sum.least_squares.pixels += of.least_squares.pixels;
  sum.robust.pixels += of.robust.pixels;
  sum.unexplained += of.unexplained;
  sum.unchecked += of.unchecked;
  total.least_squares_deg += piece.least_squares_deg;
  total.robust_deg += piece.robust_deg;
  total.turned_deg += piece.turned_deg;
}

Status CannotRead(const MosaicStack& stack) {
  return Fail(ErrorCode::kIo, "{}: rows of the mosaics cannot be read back", stack.lit[0].name);
}

// Rows [begin, end) on all threads, their sums in order.
Status SolveRowsOfMosaic(const MosaicJob& job, int begin, int end, const Task& task, SiteRows& rows,
                         RowTotals& total) {
  const int grain = RowsPerPiece(job.stack.size_px);
  std::vector<RowTotals> pieces(static_cast<size_t>(end - begin));
  std::atomic<bool> is_read = true;
  Status status = ParallelFor(end - begin, grain, task, [&](int from, int to) {
    if (!SolvePiece(job, begin + from, begin + to, rows, pieces[static_cast<size_t>(from)])) {
      is_read = false;
    }
  });
  for (const RowTotals& piece : pieces) {
    AddTotals(piece, total);
  }
  return status && !is_read ? CannotRead(job.stack) : status;
}

// Whether so many of some rows climb that rung 1 is to be doubted in what noise hides.
Result<bool> ShouldDoubt(const MosaicJob& job, const Task& task) {
  const int height = job.stack.size_px.height;
  const int probes = std::min(kProbes, height);
  std::vector<RowTotals> pieces(static_cast<size_t>(probes));
  std::atomic<bool> is_read = true;
  const Task silent{.threads = task.threads, .progress = nullptr, .cancel = task.cancel};
  const Status status = ParallelFor(probes, 1, silent, [&](int probe, int) {
    const auto row = static_cast<int>((static_cast<int64_t>(probe) * 2 + 1) * height / (2 * probes));
    SiteRows rows;
    rows.Resize(row, {job.stack.size_px.width, 1}, true);
    if (!SolvePiece(job, row, row + 1, rows, pieces[static_cast<size_t>(probe)])) {
      is_read = false;
    }
  });
  RowTotals total;
  for (const RowTotals& piece : pieces) {
    AddTotals(piece, total);
  }
  if (!status || !is_read) {
    return tl::unexpected(status ? CannotRead(job.stack).error() : status.error());
  }
  return static_cast<double>(total.counts.robust.pixels) >
         kDoubtfulShare * static_cast<double>(total.counts.solved);
}

SolveSummary SummaryOf(const RowTotals& total, const MosaicOptions& options, const Task& task,
                       double seconds) {
  SolveSummary summary = total.counts;
  const auto mean = [](double sum, int64_t count) {
    return count > 0 ? sum / static_cast<double>(count) : 0.0;
  };
  summary.pixels = summary.solved + summary.dark + summary.too_few_samples + summary.saturated +
                   summary.ill_conditioned;
  summary.least_squares.mean_uncertainty_deg =
      mean(total.least_squares_deg, summary.least_squares.pixels);
  summary.robust.mean_uncertainty_deg = mean(total.robust_deg, summary.robust.pixels);
  summary.turned_deg = mean(total.turned_deg, summary.robust.pixels);
  summary.noise_known = options.mode.has_value();
  summary.noise_scale = options.mode ? 1.0 : 0.0;
  summary.seconds = seconds;
  summary.least_squares.seconds = options.mode ? seconds : 0.0;
  summary.threads = task.ThreadCount();
  summary.backend = options.least_squares.backend;
  if (summary.backend == Backend::kFast || summary.backend == Backend::kAuto) {
    summary.instruction_set = KernelInstructionSet();
  }
  return summary;
}

// The rows above and below a band, whose albedo its own outermost rows are interpolated from.
struct Halo {
  std::vector<float> above;
  std::vector<float> below;
};

Status SolveHalo(const MosaicJob& job, int row, std::vector<float>& own_colour) {
  own_colour.clear();
  if (row < 0 || row >= job.stack.size_px.height) {
    return {};
  }
  SiteRows rows;
  RowTotals ignored;
  rows.Resize(row, {job.stack.size_px.width, 1}, job.options.mode.has_value());
  if (!SolvePiece(job, row, row + 1, rows, ignored)) {
    return CannotRead(job.stack);
  }
  own_colour = std::move(rows.own_colour.pixels);
  return {};
}

Status SolveBand(const MosaicJob& job, int begin, int end, const Task& task, SiteRows& rows,
                 RowTotals& total) {
  rows.Resize(begin, {job.stack.size_px.width, end - begin}, job.options.mode.has_value());
  Halo halo;
  const Status status =
      SolveRowsOfMosaic(job, begin, end, task, rows, total)
          .and_then([&] { return SolveHalo(job, begin - 1, halo.above); })
          .and_then([&] { return SolveHalo(job, end, halo.below); });
  return status ? InterpolateAlbedo(job.stack.cfa, begin, rows.own_colour,
                                    {halo.above, halo.below}, task, rows.field)
                : status;
}

}  // namespace

Status MosaicOptions::Validate() const {
  if (band_rows != 0 && band_rows < 2) {
    return Fail(ErrorCode::kInvalidArgument, "band_rows = {}; need 0 or at least 2", band_rows);
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
  const Clock::time_point start = Clock::now();
  if (const Status status =
          options.Validate().and_then([&] { return CheckMosaics(stack, rig, mask, options); });
      !status) {
    return tl::unexpected(status.error());
  }
  const Result<MosaicFeed> feed =
      MosaicFeed::Make(stack, rig, options.least_squares, options.mode.has_value());
  if (!feed) {
    return tl::unexpected(feed.error());
  }
  MosaicJob job{stack, rig, mask ? &*mask : nullptr, options, *feed};
  job.limit.fill(std::numeric_limits<float>::infinity());
  for (size_t usable = 4; usable < job.limit.size(); ++usable) {
    job.limit[usable] = static_cast<float>(
        ChiSquaredQuantile(1.0 - options.false_alarms, static_cast<int>(usable) - 3));
  }
  if (options.mode == LadderMode::kAuto) {
    const Result<bool> doubt = ShouldDoubt(job, task);
    if (!doubt) {
      return tl::unexpected(doubt.error());
    }
    job.doubt = *doubt;
  }
  const int height = stack.size_px.height;
  const int band = options.band_rows == 0 ? height : options.band_rows;
  task.BeginStage("solving", height);
  RowTotals total;
  std::array<SiteRows, 2> rows;  // one is handed on while the other is solved
  std::future<Status> handed_on;
  Status status;
  for (int begin = 0, k = 0; status && begin < height; begin += band, ++k) {
    SiteRows& now = rows[static_cast<size_t>(k % 2)];
    status = SolveBand(job, begin, std::min(begin + band, height), task, now, total);
    const Status before = handed_on.valid() ? handed_on.get() : Status();
    status = before ? status : before;
    if (status) {
      handed_on = std::async(std::launch::async,
                             [&sink, &now, begin] { return sink(begin, now.field); });
    }
  }
  const Status last = handed_on.valid() ? handed_on.get() : Status();
  if (!status || !last) {
    return tl::unexpected(status ? last.error() : status.error());
  }
  return SummaryOf(total, options, task, SecondsFrom(start));
}

Result<NormalField> SolveMosaic(const MosaicStack& stack, const Rig& rig,
                                const std::optional<Mask>& mask, const MosaicOptions& options,
                                const Task& task) {
  if (const Status valid = options.Validate(); !valid) {
    return tl::unexpected(valid.error());
  }
  MosaicOptions whole = options;
  whole.band_rows = 0;
  NormalField field;
  return SolveMosaicByBands(stack, rig, mask, whole, task,
                            [&](int /*first_row*/, NormalField& band) {
                              field = std::move(band);
                              return Status();
                            })
      .map([&](const SolveSummary& summary) {
        field.summary = summary;
        return std::move(field);
      });
}

}  // namespace sateen
