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

void ResizeMaps(ImageSize size, bool with_ladder, NormalField& field) {
  field.Resize(size);
  const ImageSize ladder_size = with_ladder ? size : ImageSize{};
  if (field.model.Size() != ladder_size) {
    field.uncertainty = Image<float>(ladder_size);
    field.model = Image<uint8_t>(ladder_size);
  }
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
      return Fail(
          ErrorCode::kBadData,
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
  NormalField& field = rows.Field();
  for (int row = piece.Begin(); row < piece.End(); ++row) {
    for (int column = 0; column < job.stack.size_px.width; ++column) {
      const size_t p = rows.Index(row) + static_cast<size_t>(column);
      const bool inside = job.mask == nullptr || job.mask->At(column, row) != 0;
      if (!inside ||
          !(all || field.reason.pixels[p] == static_cast<uint8_t>(Reason::kIllConditioned))) {
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
      rows.OwnColour(p) = has_answer ? static_cast<float>(length) : 0.0F;
      field.residual.pixels[p] = static_cast<float>(solution.residual);
      field.samples.pixels[p] = static_cast<uint8_t>(std::min(solution.samples, 255));
      field.reason.pixels[p] = static_cast<uint8_t>(solution.reason);
      if (job.options.mode) {
        field.uncertainty.pixels[p] = static_cast<float>(std::min(solution.uncertainty_deg, 180.0));
        rows.Misfit(p) = static_cast<float>(solution.misfit);
      }
      ++solved;
    }
  }
  return solved;
}

bool MustClimb(const MosaicJob& job, SiteRows& rows, size_t p) {
  const uint8_t samples = rows.Field().samples.pixels[p];
  if (samples <= 3 || *job.options.mode == LadderMode::kLeastSquares) {
    return false;
  }
  if (*job.options.mode == LadderMode::kConsensus) {
    return true;
  }
  return rows.Misfit(p) > job.limit[samples] &&
         rows.Field().residual.pixels[p] >
             static_cast<float>(job.options.explained_residual) * rows.OwnColour(p);
}

Eigen::Vector3f SiteNormal(const NormalField& field, size_t p) {
  return {field.normal[0].pixels[p], field.normal[1].pixels[p], field.normal[2].pixels[p]};
}

void ClimbSites(const MosaicJob& job, const MosaicPiece& piece, std::span<const size_t> sites,
                SiteRows& rows, RowTotals& totals) {
  std::vector<Eigen::Vector3f> before;
  before.reserve(sites.size());
  for (const size_t p : sites) {
    before.push_back(SiteNormal(rows.Field(), p));
  }
  std::vector<uint8_t> agreeing(sites.size());
  job.feed.SolveConsensus(piece, sites, rows, agreeing);
  for (size_t j = 0; j < sites.size(); ++j) {
    const bool is_explained = agreeing[j] >= kFewestAgreeing;
    float& uncertainty = rows.Field().uncertainty.pixels[sites[j]];
    if (!is_explained) {
      uncertainty = std::min(180.0F, uncertainty * kUnexplainedFactor);
      ++totals.counts.unexplained;
    }
    rows.Field().model.pixels[sites[j]] =
        static_cast<uint8_t>(is_explained ? Rung::kConsensus : Rung::kUnexplained);
    const Eigen::Vector3f after = SiteNormal(rows.Field(), sites[j]);
    totals.turned_deg += std::atan2(static_cast<double>(before[j].cross(after).norm()),
                                    static_cast<double>(before[j].dot(after))) *
                         kDegPerRad;
    totals.robust_deg += static_cast<double>(uncertainty);
  }
  totals.counts.robust.pixels += static_cast<int64_t>(sites.size());
}

// Rung 1's word on the piece's sites, then rung 2's on those that climb.
void Climb(const MosaicJob& job, const MosaicPiece& piece, SiteRows& rows, RowTotals& totals) {
  NormalField& field = rows.Field();
  std::vector<size_t> sites;
  const size_t end = rows.Index(piece.End());
  for (size_t p = rows.Index(piece.Begin()); p < end; ++p) {
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
  const size_t end = rows.Index(piece.End());
  std::array<int64_t, 256> of = {};
  for (size_t p = rows.Index(piece.Begin()); p < end; ++p) {
    ++of[rows.Field().reason.pixels[p]];
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

// A row by itself: totals, and the albedo of its sites' own colours. False where it cannot be read.
bool SolveRowAlone(const MosaicJob& job, int row, RowTotals& totals, std::vector<float>& own) {
  NormalField field;
  SiteRows rows;
  ResizeMaps({job.stack.size_px.width, 1}, job.options.mode.has_value(), field);
  rows.Begin(row, row + 1, field, row, job.options.mode.has_value());
  if (!SolvePiece(job, row, row + 1, rows, totals)) {
    return false;
  }
  own.assign(&rows.OwnColour(0), &rows.OwnColour(0) + job.stack.size_px.width);
  return true;
}

// Whether so many of some rows climb that rung 1 is to be doubted in what noise hides.
Result<bool> ShouldDoubt(const MosaicJob& job, const Task& task) {
  const int height = job.stack.size_px.height;
  const int probes = std::min(kProbes, height);
  std::vector<RowTotals> pieces(static_cast<size_t>(probes));
  std::atomic<bool> is_read = true;
  const Task silent{.threads = task.threads, .progress = nullptr, .cancel = task.cancel};
  const Status status = ParallelFor(probes, 1, silent, [&](int probe, int) {
    const auto row =
        static_cast<int>((static_cast<int64_t>(probe) * 2 + 1) * height / (2 * probes));
    std::vector<float> own;
    if (!SolveRowAlone(job, row, pieces[static_cast<size_t>(probe)], own)) {
      is_read = false;
    }
  });
  if (!status || !is_read) {
    return tl::unexpected(status ? CannotRead(job.stack).error() : status.error());
  }
  RowTotals total;
  for (const RowTotals& piece : pieces) {
    AddTotals(piece, total);
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

// One band after the other into maps, their own or those of the whole image.
class BandSolver {
 public:
  BandSolver(const MosaicJob& job, const Task& task) : job_(job), task_(task) {}

  // Rows [begin, end), which follow those of the call before; row 0 of `field` is `field_row`.
  Status Solve(int begin, int end, NormalField& field, int field_row) {
    rows_.Begin(begin, end, field, field_row, job_.options.mode.has_value());
    RowTotals ignored;
    below_.clear();
    const Status status = SolveRowsOfMosaic(job_, begin, end, task_, rows_, total_);
    if (status && end < job_.stack.size_px.height && !SolveRowAlone(job_, end, ignored, below_)) {
      return CannotRead(job_.stack);
    }
    return status.and_then([&] { return InterpolateAlbedo(begin, end); });
  }
  [[nodiscard]] const RowTotals& Total() const { return total_; }

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
    const Status status =
        ParallelFor(end - begin, RowsPerPiece(job_.stack.size_px), silent, [&](int from, int to) {
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
  RowTotals total_;
  // Own colours just beyond the band; empty at the image's border.
  std::vector<float> above_;
  std::vector<float> below_;
};

// What every solve begins with.
struct Prepared {
  MosaicFeed feed;
  std::array<float, 256> limit = {};
  bool doubt = false;
};

Result<Prepared> Prepare(const MosaicStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                         const MosaicOptions& options, const Task& task) {
  if (const Status status =
          options.Validate().and_then([&] { return CheckMosaics(stack, rig, mask, options); });
      !status) {
    return tl::unexpected(status.error());
  }
  Result<MosaicFeed> feed =
      MosaicFeed::Make(stack, rig, options.least_squares, options.mode.has_value());
  if (!feed) {
    return tl::unexpected(feed.error());
  }
  Prepared prepared{*std::move(feed)};
  prepared.limit.fill(std::numeric_limits<float>::infinity());
  for (size_t usable = 4; usable < prepared.limit.size(); ++usable) {
    prepared.limit[usable] = static_cast<float>(
        ChiSquaredQuantile(1.0 - options.false_alarms, static_cast<int>(usable) - 3));
  }
  if (options.mode == LadderMode::kAuto) {
    const Result<bool> doubt = ShouldDoubt(
        {stack, rig, mask ? &*mask : nullptr, options, prepared.feed, prepared.limit}, task);
    if (!doubt) {
      return tl::unexpected(doubt.error());
    }
    prepared.doubt = *doubt;
  }
  task.BeginStage("solving", stack.size_px.height);
  return prepared;
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
  const Clock::time_point start = Clock::now();
  const Result<Prepared> prepared = Prepare(stack, rig, mask, options, task);
  if (!prepared) {
    return tl::unexpected(prepared.error());
  }
  const MosaicJob job{
      stack,          rig, mask ? &*mask : nullptr, options, prepared->feed, prepared->limit,
      prepared->doubt};
  const int height = stack.size_px.height;
  BandSolver solver(job, task);
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
  if (!status || !last) {
    return tl::unexpected(status ? last.error() : status.error());
  }
  return SummaryOf(solver.Total(), options, task, SecondsFrom(start));
}

Status SolveMosaicInto(const MosaicStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                       const MosaicOptions& options, const Task& task, NormalField& field) {
  const Clock::time_point start = Clock::now();
  const Result<Prepared> prepared = Prepare(stack, rig, mask, options, task);
  if (!prepared) {
    return tl::unexpected(prepared.error());
  }
  const MosaicJob job{
      stack,          rig, mask ? &*mask : nullptr, options, prepared->feed, prepared->limit,
      prepared->doubt};
  ResizeMaps(stack.size_px, options.mode.has_value(), field);
  BandSolver solver(job, task);
  Status status;
  for (int begin = 0; status && begin < stack.size_px.height; begin += options.band_rows) {
    status =
        solver.Solve(begin, std::min(begin + options.band_rows, stack.size_px.height), field, 0);
  }
  field.summary = SummaryOf(solver.Total(), options, task, SecondsFrom(start));
  return status;
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
