#include "scanner/sessions/sheet_blocks.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/statistics.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr double kMostSpoilt = 0.5;   // share of a frame's blocks
constexpr double kDarkSignal = 20.0;  // times its own standard deviation: light, not noise
// Variance for a noiseless simulation, so that weights stay finite.
constexpr double kSmallestVariance = 1e-14;

// Variance of a site over its radiance, for each colour: on white paper all noise is that of the
// light. One figure for the frame, because what a single block shows is uncertain by a third, and
// weights as uncertain as that cost precision; the median, so that folds and edges do not count.
Eigen::Array3d NoisePerRadiance(const BlockMeans& means) {
  Eigen::Array3d noise = Eigen::Array3d::Constant(kSmallestVariance);
  for (Eigen::Index c = 0; c < 3; ++c) {
    std::vector<double> ratios;
    ratios.reserve(means.blocks.size());
    for (const BlockMean& block : means.blocks) {
      if (!block.saturated && block.radiance_rgb[c] > 0.0) {
        ratios.push_back(block.site_variance_rgb[c] / block.radiance_rgb[c]);
      }
    }
    if (!ratios.empty()) {
      noise[c] = std::max(Median(std::move(ratios)), kSmallestVariance);
    }
  }
  return noise;
}

// Where a pixel's ray meets the sheet.
std::optional<Eigen::Vector3d> SheetPointOfPixel(const Camera& camera,
                                                 const Eigen::Isometry3d& table_from_sheet,
                                                 const Eigen::Vector2d& pixel) {
  const std::optional<Eigen::Vector3d> ray = RayOfPixel(camera, pixel.x(), pixel.y());
  if (!ray) {
    return std::nullopt;
  }
  const Eigen::Vector3d normal = table_from_sheet.linear().col(2);
  const Eigen::Vector3d eye_mm = camera.table_from_camera.translation();
  const double t = normal.dot(table_from_sheet.translation() - eye_mm) / normal.dot(*ray);
  return t > 0.0 ? std::optional<Eigen::Vector3d>(eye_mm + t * *ray) : std::nullopt;
}

// Returns whether a block shows nothing but the blank inside of the sheet.
bool IsBlank(const Camera& camera, const Eigen::Isometry3d& table_from_sheet,
             const Eigen::AlignedBox2d& extent_px, const SheetBorder& border) {
  using Corner = Eigen::AlignedBox2d::CornerType;
  for (const Corner corner :
       {Corner::BottomLeft, Corner::BottomRight, Corner::TopLeft, Corner::TopRight}) {
    const auto point = SheetPointOfPixel(camera, table_from_sheet, extent_px.corner(corner));
    if (!point ||
        !border.BlankMm().contains((table_from_sheet.inverse() * *point).head<2>().eval())) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::vector<BlockSample> BlockSamplesOf(const BlockMeans& means,
                                        const std::vector<Eigen::Vector3d>& dark) {
  const Eigen::Array3d noise = NoisePerRadiance(means);
  std::vector<BlockSample> blocks;
  blocks.reserve(means.blocks.size());
  for (size_t i = 0; i < means.blocks.size(); ++i) {
    const BlockMean& mean = means.blocks[i];
    BlockSample block{.sample = {.radiance_rgb = mean.radiance_rgb}, .saturated = mean.saturated};
    if (!dark.empty()) {
      block.sample.radiance_rgb -= dark[i];
    }
    const Eigen::Array3d variance = noise * mean.radiance_rgb.array() / mean.sites_rgb.array();
    block.sample.sd_rgb = variance.max(kSmallestVariance).sqrt();
    block.is_lit =
        (block.sample.radiance_rgb.array() > kDarkSignal * block.sample.sd_rgb.array()).all();
    blocks.push_back(block);
  }
  return blocks;
}

Places PlacesOf(const BlockMeans& means, const Camera& camera,
                const Eigen::Isometry3d& table_from_sheet,
                const std::optional<SheetBorder>& border) {
  Places places;
  places.reserve(means.blocks.size());
  for (int row = 0; row < means.grid.rows; ++row) {
    for (int column = 0; column < means.grid.columns; ++column) {
      const bool usable =
          !border || IsBlank(camera, table_from_sheet, means.Extent(column, row), *border);
      places.push_back(usable
                           ? SheetPointOfPixel(camera, table_from_sheet, means.Center(column, row))
                           : std::nullopt);
    }
  }
  return places;
}

FrameFault Spoilt::Fault() const {
  return saturated > kMostSpoilt ? FrameFault::kSaturated
         : unlit > kMostSpoilt   ? FrameFault::kDark
                                 : FrameFault::kNone;
}

Spoilt SpoiltOf(const std::vector<BlockSample>& blocks, const Places& places) {
  double count = 0.0;
  Spoilt spoilt;
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (places[i]) {
      count += 1.0;
      spoilt.saturated += blocks[i].saturated ? 1.0 : 0.0;
      spoilt.unlit += blocks[i].is_lit ? 0.0 : 1.0;
    }
  }
  return {.saturated = spoilt.saturated / count, .unlit = spoilt.unlit / count};
}

}  // namespace sateen
