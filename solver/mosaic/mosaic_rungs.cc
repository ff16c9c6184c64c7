#include "solver/mosaic/mosaic_rungs.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "solver/least_squares/least_squares.h"
#include "solver/mosaic/mosaic_site.h"

namespace sateen {
namespace {

// Solves the sites that the kernel refused, or all, in double. Returns their number.
int64_t SolveInDouble(const MosaicJob& job, const MosaicPiece& piece, bool all, SiteRows& rows) {
  MosaicSite site(job.input, job.options.least_squares, job.options.mode.has_value());
  const auto width = static_cast<size_t>(job.input.stack.size_px.width);
  std::vector<uint16_t> readings(job.input.stack.lit.size());
  int64_t solved = 0;
  NormalField& field = rows.Field();
  for (int row = piece.Begin(); row < piece.End(); ++row) {
    for (int column = 0; column < job.input.stack.size_px.width; ++column) {
      const size_t p = rows.Index(row) + static_cast<size_t>(column);
      const bool inside = job.input.mask == nullptr || job.input.mask->At(column, row) != 0;
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
        field.uncertainty.pixels[p] = static_cast<float>(std::min(180.0, solution.uncertainty_deg));
        field.albedo_uncertainty.pixels[p] =
            static_cast<float>(std::min(1.0, solution.albedo_uncertainty));
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
             static_cast<float>(job.options.climb.explained_residual) * rows.OwnColour(p);
}

// Gives rung 3 to the sites that the scene's lobe explains.
void SolveSitesUnderLobe(const MosaicJob& job, const MosaicPiece& piece, SiteRows& rows,
                         PieceSummary& summary) {
  MosaicSite site(job.input, job.options.least_squares, true);
  NormalField& field = rows.Field();
  for (int row = piece.Begin(); row < piece.End(); ++row) {
    for (int column = 0; column < job.input.stack.size_px.width; ++column) {
      const size_t p = rows.Index(row) + static_cast<size_t>(column);
      const std::optional<Eigen::Vector3d> v =
          IsSolved(field, p) ? ViewOf(job.input.rig, column, row) : std::nullopt;
      if (!v) {
        continue;
      }
      const std::optional<LobeSamples> samples =
          site.LobeSamplesAt(column, row, piece, *v, job.limit);
      const LobeAnswer answer = samples ? SolveLobe(*samples, *job.lobe) : LobeAnswer{};
      if (answer.n.isZero() || !(answer.misfit <= samples->limit)) {
        continue;
      }
      const auto albedo = static_cast<float>(answer.albedo[0]);
      const Estimate of_rung_1 = EstimatesAt(field, std::span(&p, 1), [&](size_t site_at) {
                                   return rows.OwnColour(site_at);
                                 }).front();
      if (TakesLobe(answer, albedo, job.lobe->share, static_cast<double>(rows.Misfit(p)), of_rung_1,
                    field, p)) {
        rows.OwnColour(p) = albedo;
        ++summary.lobe;
      }
    }
  }
}

// Judges rung 1 on the piece's sites, tries rung 3 where the scene has a lobe, then solves the
// sites that climb on rung 2.
void ClimbSites(const MosaicJob& job, const MosaicPiece& piece, SiteRows& rows,
                PieceSummary& summary) {
  NormalField& field = rows.Field();
  std::vector<size_t> sites;
  const size_t begin = rows.Index(piece.Begin());
  const size_t end = rows.Index(piece.End());
  std::fill(field.model.pixels.begin() + static_cast<std::ptrdiff_t>(begin),
            field.model.pixels.begin() + static_cast<std::ptrdiff_t>(end),
            static_cast<uint8_t>(Rung::kNone));
  if (job.lobe) {
    summary.lobe_seconds += SecondsOf([&] { SolveSitesUnderLobe(job, piece, rows, summary); });
  }
  for (int row = piece.Begin(); job.light_doubt && row < piece.End(); ++row) {
    job.light_doubt->AddToRow(row, rows.Index(row), field);
  }
  for (size_t p = begin; p < end; ++p) {
    if (!IsSolved(field, p)) {
      field.uncertainty.pixels[p] = field.albedo_uncertainty.pixels[p] = 0.0F;
      continue;
    }
    if (field.model.pixels[p] == static_cast<uint8_t>(Rung::kLobe)) {
      summary.lobe_deg += static_cast<double>(field.uncertainty.pixels[p]);
      continue;
    }
    const Rung rung = field.samples.pixels[p] <= 3 ? Rung::kUnchecked : Rung::kLeastSquares;
    field.model.pixels[p] = static_cast<uint8_t>(rung);
    if (MustClimb(job, rows, p)) {
      sites.push_back(p);
      continue;
    }
    float& uncertainty = field.uncertainty.pixels[p];
    if (job.doubt.IsNone()) {
      uncertainty = std::min(180.0F, uncertainty);
    } else {
      job.doubt.AddTo(field, p);
    }
    summary.least_squares_deg += static_cast<double>(uncertainty);
    ++(rung == Rung::kUnchecked ? summary.unchecked : summary.least_squares);
  }
  if (!sites.empty()) {
    summary.climbing_seconds += SecondsOf([&] {
      const auto albedo = [&](size_t p) { return rows.OwnColour(p); };
      const std::vector<Estimate> before = EstimatesAt(field, sites, albedo);
      std::vector<uint8_t> agreeing(sites.size());
      job.consensus.Solve(piece, sites, rows, agreeing);
      JudgeConsensus(sites, before, EstimatesAt(field, sites, albedo), agreeing, field, summary);
    });
  }
}

std::span<const uint8_t> ReasonsOf(const MosaicPiece& piece, const SiteRows& rows) {
  const size_t begin = rows.Index(piece.Begin());
  return std::span(rows.Field().reason.pixels).subspan(begin, rows.Index(piece.End()) - begin);
}

}  // namespace

bool SolvePiece(const MosaicJob& job, int begin, int end, SiteRows& rows, PieceSummary& summary) {
  MosaicPiece piece = job.pieces.Take();
  job.feed.Read(begin, end, piece);
  if (!piece.IsRead()) {
    return false;
  }
  const Backend backend = job.options.least_squares.backend;
  const bool in_double = backend != Backend::kFast && backend != Backend::kAuto;
  job.feed.Solve(piece, job.input.mask, rows);
  if (in_double ||
      (backend == Backend::kAuto &&
       CountOf(static_cast<uint8_t>(Reason::kIllConditioned), ReasonsOf(piece, rows)) > 0)) {
    const int64_t solved = SolveInDouble(job, piece, in_double, rows);
    summary.counts.resolved_by_reference += in_double ? 0 : solved;
  }
  if (job.options.mode) {
    ClimbSites(job, piece, rows, summary);
  }
  CountReasons(ReasonsOf(piece, rows), summary.counts);
  job.pieces.Give(std::move(piece));
  return true;
}

bool SolveRowAlone(const MosaicJob& job, int row, PieceSummary& summary, std::vector<float>& own) {
  NormalField field;
  SiteRows rows;
  const int width = job.input.stack.size_px.width;
  field.Resize({width, 1}, job.options.mode.has_value());
  rows.Begin(row, row + 1, field, row, job.options.mode.has_value());
  if (!SolvePiece(job, row, row + 1, rows, summary)) {
    return false;
  }
  own.assign(&rows.OwnColour(0), &rows.OwnColour(0) + width);
  return true;
}

}  // namespace sateen
