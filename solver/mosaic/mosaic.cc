#include "solver/mosaic/mosaic.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <future>
#include <utility>

#include "core/stopwatch.h"
#include "solver/kernels/mosaic_kernel.h"
#include "solver/least_squares/least_squares.h"
#include "solver/mosaic/mosaic_bands.h"
#include "solver/mosaic/mosaic_consensus.h"
#include "solver/mosaic/mosaic_feed.h"
#include "solver/mosaic/mosaic_noise.h"
#include "solver/mosaic/mosaic_probe.h"
#include "solver/mosaic/mosaic_rungs.h"
#include "solver/robust/rungs.h"

namespace sateen {
namespace {

constexpr size_t kFewestLights = 3;

Status CheckMosaics(const MosaicInput& input) {
  const MosaicStack& stack = input.stack;
  const Rig& rig = input.rig;
  const ImageSize size = stack.size_px;
  if (stack.rows == nullptr) {
    return Fail(ErrorCode::kBadData,
                "the mosaics have no readings; give them to MosaicStack::rows");
  }
  if (stack.lit.size() != rig.lights.size()) {
    return Fail(ErrorCode::kBadData, "{} frames but {} lights; need one light per frame",
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
  if (input.mask != nullptr && input.mask->Size() != size) {
    return Fail(ErrorCode::kBadData, "the mask is {}x{} px but the frames are {}x{} px",
                input.mask->width, input.mask->height, size.width, size.height);
  }
  if (Status status =
          rig.Validate("rig").and_then([&] { return CheckHeight(input.height_mm, rig, size); });
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

SolveSummary SummaryOf(const PieceSummary& total, const MosaicJob& job, bool is_noise_known,
                       const Task& task, double seconds) {
  SolveSummary summary = total.counts;
  FinishSummary(job.options.least_squares, task, summary);
  summary.seconds = seconds;
  if (job.options.mode) {
    ReportRungs(total, summary);
    summary.noise_known = is_noise_known;
    const double gain = job.input.stack.lit[0].gain_dn;
    summary.noise_scale = is_noise_known ? 1.0 : gain < kUnknownGain ? std::sqrt(gain) : 0.0;
  }
  summary.lobe = job.lobe;
  return summary;
}

Status MeasureNoiseInto(const MosaicInput& input, const MosaicOptions& options, const Task& task,
                        MosaicStack& stack) {
  const Result<double> gain = MeasureGain(input, options.least_squares, task);
  if (!gain) {
    return tl::unexpected(gain.error());
  }
  for (MosaicFrame& frame : stack.lit) {
    frame.gain_dn = *gain;
    frame.read_dn = kRoundingDn;
  }
  return {};
}

// Prepares and sums up a solve. `solve_bands` gives every band to the solver, in order.
Result<SolveSummary> SolveBandsBy(const MosaicInput& input, const MosaicOptions& options,
                                  const Task& task,
                                  const std::function<Status(BandSolver&)>& solve_bands) {
  const Stopwatch stopwatch;
  if (const Status status = options.Validate().and_then([&] { return CheckMosaics(input); });
      !status) {
    return tl::unexpected(status.error());
  }
  MosaicStack stack = input.stack;
  const bool is_known = IsNoiseKnown(stack);
  if (options.mode && !is_known) {
    const Status measured = MeasureNoiseInto(input, options, task, stack);
    if (!measured) {
      return tl::unexpected(measured.error());
    }
  }
  const MosaicInput weighed = input.With(stack);
  const Result<MosaicFeed> feed =
      MosaicFeed::Make(weighed, options.least_squares, options.mode.has_value());
  if (!feed) {
    return tl::unexpected(feed.error());
  }
  const std::array<float, 256> limit = MisfitLimits(1.0, options.climb.false_alarms);
  const std::optional<LightDoubt> light_doubt = LightDoubt::Make(input.rig, stack.size_px);
  const MosaicConsensus consensus(stack, feed->Params());
  PiecePool pieces;
  MosaicJob job{weighed, options, *feed, consensus, pieces, limit, light_doubt, {}, {}};
  if (const Status probed = options.mode == LadderMode::kAuto ? ProbeMosaic(job, task) : Status();
      !probed) {
    return tl::unexpected(probed.error());
  }
  task.BeginStage("solving", stack.size_px.height);
  BandSolver solver(job, task);
  return solve_bands(solver).map(
      [&] { return SummaryOf(solver.Total(), job, is_known, task, stopwatch.Seconds()); });
}

}  // namespace

Status MosaicOptions::Validate() const {
  if (band_rows < 1) {
    return Fail(ErrorCode::kInvalidArgument, "band_rows = {}; need at least 1", band_rows);
  }
  return climb.Validate().and_then([&] { return least_squares.Validate(); });
}

Result<SolveSummary> SolveMosaicByBands(const MosaicStack& stack, const Rig& rig,
                                        const std::optional<Mask>& mask,
                                        const MosaicOptions& options, const Task& task,
                                        const BandSink& sink) {
  return SolveBandsBy({stack, rig, mask}, options, task, [&](BandSolver& solver) {
    const int height = stack.size_px.height;
    std::array<NormalField, 2> maps;  // one is handed on while the other is solved
    std::future<Status> handed_on;
    Status status;
    for (int begin = 0, k = 0; status && begin < height; begin += options.band_rows, ++k) {
      NormalField& field = maps[static_cast<size_t>(k % 2)];
      const int end = std::min(begin + options.band_rows, height);
      field.Resize({stack.size_px.width, end - begin}, options.mode.has_value());
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
                       const MosaicOptions& options, const Task& task, NormalField& field,
                       const std::optional<Image<float>>& height_mm) {
  return SolveBandsBy({stack, rig, mask, height_mm}, options, task,
                      [&](BandSolver& solver) {
                        const int height = stack.size_px.height;
                        field.Resize(stack.size_px, options.mode.has_value());
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
                                const Task& task, const std::optional<Image<float>>& height_mm) {
  NormalField field;
  return SolveMosaicInto(stack, rig, mask, options, task, field, height_mm).map([&] {
    return std::move(field);
  });
}

}  // namespace sateen
