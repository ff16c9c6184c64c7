#include "solver/mosaic/mosaic_feed.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "solver/least_squares/fast_rows.h"
#include "solver/mosaic/mosaic_site.h"

namespace sateen {
namespace {

constexpr size_t kRowsLookedAt = 32;

// Returns the variance of a white diffuser's i' under light 0: in it, float holds weights in any
// units.
double NoiseUnit(const MosaicStack& stack, const Light& light, double flux_scale) {
  const SiteNoise noise = NoiseAt(stack, 0, 0);
  const double f = flux_scale / TypicalIrradiance(light);
  const double unit = f * (noise.shot + f * noise.read_squared);
  return unit > 0.0 ? unit : 1.0;
}

MosaicKernelLight KernelLightOf(const MosaicStack& stack, size_t k, const Light& light,
                                double flux_scale, double noise_unit,
                                const LambertianOptions& options) {
  const bool is_distant = light.model == LightModel::kDistant;
  const MosaicFrame& frame = stack.lit[k];
  MosaicKernelLight of{.lamp = KernelLampOf(light), .clip_dn = ClipThreshold(frame, options)};
  for (size_t site = 0; site < 4; ++site) {
    const double flux = light.flux_rgb[stack.cfa[site]] * (is_distant ? 1.0 : 1e6) / flux_scale;
    const SiteNoise noise = NoiseAt(stack, k, site);
    of.inverse_flux[site] = static_cast<float>(1.0 / flux);
    of.per_dn[site] = static_cast<float>(static_cast<double>(frame.per_dn[site]) / flux);
    of.at_zero[site] = static_cast<float>(static_cast<double>(frame.at_zero[site]) / flux);
    of.least[site] = static_cast<float>(static_cast<double>(DarkThreshold(frame, options)) / flux);
    of.shot[site] = static_cast<float>(noise.shot / noise_unit);
    of.read_squared[site] = static_cast<float>(noise.read_squared / noise_unit);
  }
  return of;
}

}  // namespace

Result<MosaicFeed> MosaicFeed::Make(const MosaicInput& input, const LambertianOptions& options,
                                    bool weighted) {
  const MosaicStack& stack = input.stack;
  const Lights& lights = input.rig.lights;
  Result<PixelLocator> locator = PixelLocator::Make(input.rig, input.height_mm);
  if (!locator) {
    return tl::unexpected(locator.error());
  }
  MosaicFeed feed(stack, *std::move(locator));
  const double flux_scale = FluxScale(lights);
  const double noise_unit = weighted ? NoiseUnit(stack, lights[0], flux_scale) : 1.0;
  feed.params_.result_scale = static_cast<float>(1.0 / flux_scale);
  feed.params_.shadow_level = static_cast<float>(options.shadow_level);
  feed.params_.max_condition_squared = std::min(
      static_cast<float>(options.max_condition * options.max_condition), kFloatConditionSquared);
  feed.params_.weighted = weighted;
  feed.params_.noise_unit = static_cast<float>(noise_unit);
  for (size_t k = 0; k < lights.size(); ++k) {
    feed.params_.lights.push_back(
        KernelLightOf(stack, k, lights[k], flux_scale, noise_unit, options));
  }
  return feed;
}

std::vector<int> RowsLookedAt(const MosaicInput& input) {
  const ImageSize size = input.stack.size_px;
  const Mask* const mask = input.mask;
  std::vector<int> inside;
  for (int row = 0; row < size.height; ++row) {
    const uint8_t* const of_row =
        mask == nullptr ? nullptr : mask->pixels.data() + mask->Index(0, row);
    if (mask == nullptr ||
        std::any_of(of_row, of_row + size.width, [](uint8_t value) { return value != 0; })) {
      inside.push_back(row);
    }
  }
  std::vector<int> rows(std::min(kRowsLookedAt, inside.size()));
  for (size_t j = 0; j < rows.size(); ++j) {
    // Takes both parities in turn, which have other colours.
    const size_t at = (2 * j + 1) * inside.size() / (2 * rows.size());
    rows[j] = inside[std::min(at / 2 * 2 + j % 2, inside.size() - 1)];
  }
  return rows;
}

Error CannotReadBack(const MosaicStack& stack) {
  return {ErrorCode::kIo,
          fmt::format("{}: rows of the mosaics cannot be read back", stack.lit[0].name)};
}

void MosaicFeed::Read(int begin, int end, MosaicPiece& piece) const {
  piece.is_read_ = true;
  piece.width_ = static_cast<size_t>(stack_->size_px.width);
  piece.begin_ = begin;
  piece.end_ = end;
  piece.read_begin_ = std::max(0, begin - 1);
  piece.read_end_ = std::min(stack_->size_px.height, end + 1);
  piece.beyond_ =
      static_cast<size_t>(stack_->size_px.width) * static_cast<size_t>(begin - piece.read_begin_);
  const size_t frames = stack_->lit.size();
  piece.buffers_.resize(frames);
  piece.readings_.clear();
  for (size_t k = 0; k < frames; ++k) {
    const std::span<const uint16_t> rows =
        stack_->rows->Read(k, piece.read_begin_, piece.read_end_, piece.buffers_[k]);
    piece.is_read_ = piece.is_read_ && !rows.empty();
    piece.readings_.push_back(rows.data());
  }
  ReadDark(piece);
  locator_.Locate(begin, end, piece.geometry_);
}

void MosaicFeed::ReadDark(MosaicPiece& piece) const {
  if (stack_->dark.empty()) {
    return;
  }
  const auto width = static_cast<size_t>(stack_->size_px.width);
  piece.dark_.assign(width * static_cast<size_t>(piece.read_end_ - piece.read_begin_), 0.0F);
  std::vector<uint16_t> buffer;
  for (size_t k = 0; k < stack_->dark.size(); ++k) {
    const std::span<const uint16_t> rows =
        stack_->rows->Read(stack_->lit.size() + k, piece.read_begin_, piece.read_end_, buffer);
    if (rows.empty()) {
      piece.is_read_ = false;
      return;
    }
    const MosaicFrame& frame = stack_->dark[k];
    const float weight = stack_->dark_weights[k];
    for (int row = piece.read_begin_; row < piece.read_end_; ++row) {
      const size_t start = width * static_cast<size_t>(row - piece.read_begin_);
      const size_t above = static_cast<size_t>(row % 2) * 2;
      for (size_t x = 0; x < width; ++x) {
        const size_t site = above + x % 2;
        piece.dark_[start + x] +=
            weight *
            (frame.per_dn[site] * static_cast<float>(rows[start + x]) + frame.at_zero[site]);
      }
    }
  }
}

void MosaicFeed::Run(RowFunction function, const MosaicPiece& piece, const Mask* mask,
                     SiteRows& rows) const {
  const auto width = static_cast<size_t>(stack_->size_px.width);
  std::vector<const uint16_t*> readings(piece.readings_.size());
  const PixelGeometry& geometry = piece.geometry_;
  std::vector<const float*> gains(geometry.places.size());
  for (int row = piece.begin_; row < piece.end_; ++row) {
    const size_t start = width * static_cast<size_t>(row - piece.begin_);
    const size_t to = rows.Index(row);
    NormalField& field = rows.Field();
    std::ranges::transform(piece.readings_, readings.begin(),
                           [&](const uint16_t* frame) { return frame + piece.beyond_ + start; });
    std::ranges::transform(geometry.places, gains.begin(), [&](const float* of_light) {
      return of_light == nullptr ? nullptr : of_light + start;
    });
    const auto at = [&](auto& image) { return image.pixels.data() + to; };
    const auto from = [&](const std::vector<float>& values) {
      return values.empty() ? nullptr : values.data() + start;
    };
    function(params_,
             {.readings = readings.data(),
              .dark = piece.dark_.empty() ? nullptr : piece.dark_.data() + piece.beyond_ + start,
              .x_mm = from(geometry.x_mm),
              .y_mm = from(geometry.y_mm),
              .z_mm = from(geometry.z_mm),
              .inverse_gains = gains.empty() ? nullptr : gains.data(),
              .mask = mask == nullptr ? nullptr : mask->pixels.data() + mask->Index(0, row),
              .row = row,
              .count = width},
             {.normal = {at(field.normal[0]), at(field.normal[1]), at(field.normal[2])},
              .albedo = &rows.OwnColour(to),
              .residual = at(field.residual),
              .samples = at(field.samples),
              .reason = at(field.reason),
              .uncertainty = params_.weighted ? at(field.uncertainty) : nullptr,
              .albedo_uncertainty = params_.weighted ? at(field.albedo_uncertainty) : nullptr,
              .misfit = params_.weighted ? &rows.Misfit(to) : nullptr});
  }
}

void MosaicFeed::Solve(const MosaicPiece& piece, const Mask* mask, SiteRows& rows) const {
  Run(SolveMosaicRow, piece, mask, rows);
}

}  // namespace sateen
