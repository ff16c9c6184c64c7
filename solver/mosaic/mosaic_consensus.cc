#include "solver/mosaic/mosaic_consensus.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/angle.h"
#include "solver/robust/consensus.h"

namespace sateen {
namespace {

// Largest spread of the samples in interpolated colours, relative to that in the own colour, at
// which they are taken: they have their own errors at edges.
constexpr float kColourAdvantage = 0.5F;

// Returns the spread of the samples in degrees, from (6) of solver/robust/consensus.h.
float SpreadOf(float uncertainty_deg) {
  constexpr auto kLeastDeg = kLeastModelUncertainty * static_cast<float>(kDegPerRad);
  return std::sqrt(std::max(0.0F, uncertainty_deg * uncertainty_deg - kLeastDeg * kLeastDeg));
}

// Returns the search's light. Flux and saturation are already taken out of its samples.
KernelLight ConsensusLightOf(const MosaicKernelLight& light) {
  return {.lamp = light.lamp,
          .inverse_flux = {1.0F, 1.0F, 1.0F},
          .clip = std::numeric_limits<float>::infinity()};
}

}  // namespace

// Answers of the search, one entry per site.
struct MosaicConsensus::Answers {
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

MosaicConsensus::MosaicConsensus(const MosaicStack& stack, const MosaicKernelParams& params)
    : stack_(&stack),
      mosaic_(&params),
      params_{.result_scale = params.result_scale,
              .shadow_level = params.shadow_level,
              .max_condition_squared = params.max_condition_squared} {
  for (const MosaicKernelLight& light : params.lights) {
    params_.lights.push_back(ConsensusLightOf(light));
  }
}

float MosaicConsensus::SampleAt(const MosaicPiece& piece, size_t frame, int x, int y) const {
  const size_t site = static_cast<size_t>(y % 2 * 2 + x % 2);
  const MosaicKernelLight& light = mosaic_->lights[frame];
  const auto reading = static_cast<float>(piece.ReadingAt(frame, x, y));
  const float dark = piece.DarkAt(x, y);
  return reading >= light.clip_dn
             ? std::numeric_limits<float>::quiet_NaN()
             : light.per_dn[site] * reading + light.at_zero[site] - light.inverse_flux[site] * dark;
}

float MosaicConsensus::ColourAt(const MosaicPiece& piece, size_t frame, int x, int y,
                                size_t colour) const {
  if (stack_->cfa[static_cast<size_t>(y % 2 * 2 + x % 2)] == colour) {
    return SampleAt(piece, frame, x, y);
  }
  float sum = 0.0F;
  float count = 0.0F;
  for (int v = std::max(y - 1, piece.ReadBegin()); v <= std::min(y + 1, piece.ReadEnd() - 1); ++v) {
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, stack_->size_px.width - 1); ++u) {
      if (stack_->cfa[static_cast<size_t>(v % 2 * 2 + u % 2)] == colour) {
        sum += SampleAt(piece, frame, u, v);
        count += 1.0F;
      }
    }
  }
  return sum / count;
}

MosaicConsensus::Answers MosaicConsensus::Search(const MosaicPiece& piece,
                                                 std::span<const size_t> sites,
                                                 bool coloured) const {
  const size_t count = sites.size();
  const size_t frames = stack_->lit.size();
  const auto width = static_cast<size_t>(stack_->size_px.width);
  const size_t colours = coloured ? 3 : 1;
  const PixelGeometry& geometry = piece.Geometry();
  // Samples stand side by side, so that every lane of a vector has work.
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
        const int y = piece.Begin() + static_cast<int>(at / width);
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
  Answers found{.results = std::vector<float>(9 * count),
                .bytes = std::vector<uint8_t>(3 * count),
                .count = count};
  SolveConsensusSpan(params_,
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

void MosaicConsensus::Solve(const MosaicPiece& piece, std::span<const size_t> sites, SiteRows& rows,
                            std::span<uint8_t> agreeing) const {
  const size_t shift = rows.Index(piece.Begin());
  std::vector<size_t> of_piece(sites.begin(), sites.end());
  for (size_t& site : of_piece) {
    site -= shift;
  }
  Answers own = Search(piece, of_piece, false);
  Answers colours = Search(piece, of_piece, true);
  const auto width = static_cast<size_t>(stack_->size_px.width);
  NormalField& field = rows.Field();
  for (size_t j = 0; j < sites.size(); ++j) {
    const bool is_coloured =
        colours.IsSolved(j) &&
        (!own.IsSolved(j) || (colours.Agreeing(j) >= own.Agreeing(j) &&
                              colours.Spread(j) < kColourAdvantage * own.Spread(j)));
    Answers& found = is_coloured ? colours : own;
    agreeing[j] = found.IsSolved(j) ? found.Agreeing(j) : uint8_t{0};
    if (!found.IsSolved(j)) {
      continue;
    }
    for (size_t c = 0; c < 3; ++c) {
      field.normal[c].pixels[sites[j]] = found.Result(c)[j];
    }
    const size_t x = of_piece[j] % width;
    const size_t y = static_cast<size_t>(piece.Begin()) + of_piece[j] / width;
    rows.OwnColour(sites[j]) = found.Result(3 + stack_->cfa[y % 2 * 2 + x % 2])[j];
    field.residual.pixels[sites[j]] = found.Result(6)[j];
    field.uncertainty.pixels[sites[j]] = found.Result(7)[j];
    field.albedo_uncertainty.pixels[sites[j]] = found.Result(8)[j];
  }
}

}  // namespace sateen
