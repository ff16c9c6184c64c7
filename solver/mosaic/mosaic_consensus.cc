// Rung 2 of the sites of a MosaicFeed.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/angle.h"
#include "solver/kernels/consensus.h"
#include "solver/mosaic/mosaic_feed.h"

namespace sateen {
namespace {

// The search in interpolated colours, which have their own errors at edges, counts where its samples
// spread less than this part of the own colour's: highlights that the colour of a cloth has no part in.
constexpr float kColourAdvantage = 0.5F;

// What the search knows of the spread of its samples, in degrees (solver/ladder.h, (11)).
float SpreadOf(float uncertainty_deg) {
  constexpr auto kLeastDeg = kLeastModelUncertainty * static_cast<float>(kDegPerRad);
  return std::sqrt(std::max(0.0F, uncertainty_deg * uncertainty_deg - kLeastDeg * kLeastDeg));
}

}  // namespace

// Answers of the search, one entry a site.
struct MosaicFeed::Consensus {
  std::vector<float> results;  // normal, albedo of each colour, residual, both uncertainties
  std::vector<uint8_t> bytes;  // samples, reason, agreeing
  size_t count = 0;

  [[nodiscard]] float* Result(size_t index) { return results.data() + index * count; }
  [[nodiscard]] uint8_t* Byte(size_t index) { return bytes.data() + index * count; }
  [[nodiscard]] bool IsSolved(size_t j) const {
    return bytes[count + j] == static_cast<uint8_t>(Reason::kSolved);
  }
  [[nodiscard]] uint8_t Agreeing(size_t j) const { return bytes[2 * count + j]; }
  [[nodiscard]] float Spread(size_t j) const { return SpreadOf(results[7 * count + j]); }
};

float MosaicFeed::SampleAt(const MosaicPiece& piece, size_t frame, int x, int y) const {
  const size_t site = static_cast<size_t>(y % 2 * 2 + x % 2);
  const size_t at =
      static_cast<size_t>(stack_->size_px.width) * static_cast<size_t>(y - piece.read_begin_) +
      static_cast<size_t>(x);
  const MosaicKernelLight& light = params_.lights[frame];
  const auto reading = static_cast<float>(piece.readings_[frame][at]);
  const float dark = piece.dark_.empty() ? 0.0F : piece.dark_[at];
  return reading >= light.clip_dn
             ? std::numeric_limits<float>::quiet_NaN()
             : light.per_dn[site] * reading + light.at_zero[site] - light.inverse_flux[site] * dark;
}

float MosaicFeed::ColourAt(const MosaicPiece& piece, size_t frame, int x, int y,
                           size_t colour) const {
  if (stack_->cfa[static_cast<size_t>(y % 2 * 2 + x % 2)] == colour) {
    return SampleAt(piece, frame, x, y);
  }
  float sum = 0.0F;
  float count = 0.0F;
  for (int v = std::max(y - 1, piece.read_begin_); v <= std::min(y + 1, piece.read_end_ - 1); ++v) {
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, stack_->size_px.width - 1); ++u) {
      if (stack_->cfa[static_cast<size_t>(v % 2 * 2 + u % 2)] == colour) {
        sum += SampleAt(piece, frame, u, v);
        count += 1.0F;
      }
    }
  }
  return sum / count;
}

MosaicFeed::Consensus MosaicFeed::Search(const MosaicPiece& piece, std::span<const size_t> sites,
                                         bool coloured) const {
  const size_t count = sites.size();
  const size_t frames = stack_->lit.size();
  const auto width = static_cast<size_t>(stack_->size_px.width);
  const size_t colours = coloured ? 3 : 1;
  const PixelGeometry& geometry = piece.geometry_;
  // Side by side, so that every lane of a vector has work.
  std::vector<float> gathered(((colours + 1) * frames + 3) * count, 0.0F);
  size_t next = 0;
  const auto column = [&](const auto& value) {
    float* const to = gathered.data() + next;
    next += count;
    for (size_t j = 0; j < count; ++j) {
      to[j] = value(sites[j]);
    }
    return to;
  };
  std::vector<const float*> planes;
  std::vector<const float*> gains(frames, nullptr);
  for (size_t k = 0; k < frames; ++k) {
    for (size_t c = 0; c < colours; ++c) {
      planes.push_back(column([&](size_t at) {
        const int x = static_cast<int>(at % width);
        const int y = piece.begin_ + static_cast<int>(at / width);
        return coloured ? ColourAt(piece, k, x, y, c) : SampleAt(piece, k, x, y);
      }));
    }
    planes.insert(planes.end(), 3 - colours, planes.back());
    if (!geometry.places.empty() && geometry.places[k] != nullptr) {
      gains[k] = column([&](size_t at) { return geometry.places[k][at]; });
    }
  }
  const auto coordinate = [&](const std::vector<float>& of_piece) {
    return column([&](size_t at) { return of_piece.empty() ? 0.0F : of_piece[at]; });
  };
  const float* const x_mm = coordinate(geometry.x_mm);
  const float* const y_mm = coordinate(geometry.y_mm);
  const float* const z_mm = coordinate(geometry.z_mm);
  Consensus found{.results = std::vector<float>(9 * count),
                  .bytes = std::vector<uint8_t>(3 * count),
                  .count = count};
  SolveConsensusSpan(consensus_,
                     {.planes = planes.data(),
                      .x_mm = x_mm,
                      .y_mm = y_mm,
                      .z_mm = z_mm,
                      .inverse_gains = gains.data(),
                      .count = count},
                     {.normal = {found.Result(0), found.Result(1), found.Result(2)},
                      .albedo = {found.Result(3), found.Result(4), found.Result(5)},
                      .residual = found.Result(6),
                      .samples = found.Byte(0),
                      .reason = found.Byte(1),
                      .uncertainty = found.Result(7),
                      .albedo_uncertainty = found.Result(8),
                      .agreeing = found.Byte(2)});
  return found;
}

void MosaicFeed::SolveConsensus(const MosaicPiece& piece, std::span<const size_t> sites,
                                SiteRows& rows, std::span<uint8_t> agreeing) const {
  const size_t shift = rows.Index(piece.begin_);
  std::vector<size_t> of_piece(sites.begin(), sites.end());
  for (size_t& site : of_piece) {
    site -= shift;
  }
  Consensus own = Search(piece, of_piece, false);
  Consensus colours = Search(piece, of_piece, true);
  const auto width = static_cast<size_t>(stack_->size_px.width);
  NormalField& field = rows.Field();
  for (size_t j = 0; j < sites.size(); ++j) {
    const bool is_coloured =
        colours.IsSolved(j) &&
        (!own.IsSolved(j) || (colours.Agreeing(j) >= own.Agreeing(j) &&
                              colours.Spread(j) < kColourAdvantage * own.Spread(j)));
    Consensus& found = is_coloured ? colours : own;
    agreeing[j] = found.IsSolved(j) ? found.Agreeing(j) : uint8_t{0};
    if (!found.IsSolved(j)) {
      continue;
    }
    for (size_t c = 0; c < 3; ++c) {
      field.normal[c].pixels[sites[j]] = found.Result(c)[j];
    }
    const size_t x = of_piece[j] % width;
    const size_t y = static_cast<size_t>(piece.begin_) + of_piece[j] / width;
    rows.OwnColour(sites[j]) = found.Result(3 + stack_->cfa[y % 2 * 2 + x % 2])[j];
    field.residual.pixels[sites[j]] = found.Result(6)[j];
    field.uncertainty.pixels[sites[j]] = found.Result(7)[j];
    field.albedo_uncertainty.pixels[sites[j]] = found.Result(8)[j];
  }
}

}  // namespace sateen
