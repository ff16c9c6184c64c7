#include "solver/mosaic/mosaic_noise.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "core/parallel.h"
#include "core/statistics.h"
#include "solver/mosaic/mosaic_feed.h"
#include "solver/noise.h"

namespace sateen {
namespace {

// Quantiles that show the noise: on a shiny scene most sites show the shine.
constexpr double kBestMisfits = 0.05;
constexpr double kBestBends = 0.25;
// Smallest signal that counts, relative to saturation; below it rounding and read noise dominate.
constexpr float kLeastSignal = 0.01F;
constexpr size_t kFewestReadings = 4;  // to leave a residual

// Noise as one row shows it.
struct RowTells {
  bool is_read = true;
  std::array<std::vector<float>, 256> misfits;  // by usable readings
  std::vector<float> bends;                     // b^2 / 6 signal
  double excess = 0.0;                          // sum of (b^2 - 6/12) / 6 signal
};

// Adds the terms of (3) of one row and frame.
void AddBends(const MosaicFrame& frame, const MosaicPiece& piece, size_t k,
              const NormalField& field, RowTells& tells) {
  const size_t width = field.reason.pixels.size();
  const auto parity = static_cast<size_t>(piece.Begin() % 2) * 2;
  for (size_t x = 2; x + 2 < width; ++x) {
    if (!IsSolved(field, x - 2) || !IsSolved(field, x) || !IsSolved(field, x + 2)) {
      continue;
    }
    const size_t site = parity + x % 2;
    const float black = -frame.at_zero[site] / frame.per_dn[site];
    const float before = piece.Reading(k, x - 2);
    const float here = piece.Reading(k, x);
    const float after = piece.Reading(k, x + 2);
    const float signal = (before + here + after) / 3.0F - black;
    if (std::max({before, here, after}) < frame.saturated_dn &&
        signal > kLeastSignal * (frame.saturated_dn - black)) {
      const float bend = before - 2.0F * here + after;
      tells.bends.push_back(bend * bend / (6.0F * signal));
      tells.excess += static_cast<double>((bend * bend - 0.5F) / (6.0F * signal));
    }
  }
}

RowTells LookAtRow(const MosaicInput& input, const MosaicFeed& feed, int row) {
  RowTells tells;
  MosaicPiece piece;
  feed.Read(row, row + 1, piece);
  tells.is_read = piece.IsRead();
  if (!tells.is_read) {
    return tells;
  }
  NormalField field;
  field.Resize({input.stack.size_px.width, 1}, /*with_ladder=*/true);
  SiteRows rows;
  rows.Begin(row, row + 1, field, row, /*with_ladder=*/true);
  feed.Solve(piece, input.mask, rows);
  for (size_t x = 0; x < field.reason.pixels.size(); ++x) {
    if (IsSolved(field, x)) {
      tells.misfits[field.samples.pixels[x]].push_back(rows.Misfit(x));
    }
  }
  for (size_t k = 0; k < input.stack.lit.size(); ++k) {
    AddBends(input.stack.lit[k], piece, k, field, tells);
  }
  return tells;
}

double GainOf(const std::vector<float>& values, double share, int freedom) {
  if (values.empty()) {
    return std::numeric_limits<double>::infinity();
  }
  return static_cast<double>(Quantile(values, share)) / ReducedChiSquaredQuantile(share, freedom);
}

// Returns (1).
double GainOfRows(std::vector<RowTells>& rows) {
  RowTells all;
  for (const RowTells& row : rows) {
    all.bends.insert(all.bends.end(), row.bends.begin(), row.bends.end());
    all.excess += row.excess;
    for (size_t samples = kFewestReadings; samples < all.misfits.size(); ++samples) {
      all.misfits[samples].insert(all.misfits[samples].end(), row.misfits[samples].begin(),
                                  row.misfits[samples].end());
    }
  }
  const auto usual = std::ranges::max_element(all.misfits, {}, &std::vector<float>::size);
  const auto freedom = static_cast<int>(usual - all.misfits.begin()) - 3;
  double of_bends = GainOf(all.bends, kBestBends, 1);
  if (of_bends == 0.0) {
    of_bends = std::max(0.0, all.excess / static_cast<double>(all.bends.size()));
  }
  return std::min({GainOf(*usual, kBestMisfits, std::max(1, freedom)), of_bends, kUnknownGain});
}

}  // namespace

Result<double> MeasureGain(const MosaicInput& input, const LambertianOptions& options,
                           const Task& task) {
  MosaicStack unit = input.stack;
  for (MosaicFrame& frame : unit.lit) {
    frame.gain_dn = 1.0;
    frame.read_dn = kRoundingDn;
  }
  const MosaicInput with_unit = input.With(unit);
  const Result<MosaicFeed> feed = MosaicFeed::Make(with_unit, options, /*weighted=*/true);
  if (!feed) {
    return tl::unexpected(feed.error());
  }
  const std::vector<int> places = RowsLookedAt(input);
  std::vector<RowTells> rows(places.size());
  const Task silent{.threads = task.threads, .progress = nullptr, .cancel = task.cancel};
  const Status looked =
      ParallelFor(static_cast<int>(places.size()), 1, silent, [&](int j, int /*end*/) {
        const auto at = static_cast<size_t>(j);
        rows[at] = LookAtRow(with_unit, *feed, places[at]);
      });
  if (!looked) {
    return tl::unexpected(looked.error());
  }
  if (!std::ranges::all_of(rows, &RowTells::is_read)) {
    return tl::unexpected(CannotReadBack(input.stack));
  }
  return GainOfRows(rows);
}

}  // namespace sateen
