#include "scanner/sessions/files/patch_places.h"

#include <algorithm>
#include <cmath>

#include "core/whole_number.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr double kRead = 0.6;  // share of a patch's side that is read

}  // namespace

PatchPlaces PlacesOf(const ChartPatch& patch, double patch_mm, const Camera& camera,
                     const Eigen::Isometry2d& table_from_chart, const RawMosaic& mosaic) {
  const double read_mm = kRead * patch_mm;
  PatchPlaces places;
  Eigen::Array2d low = Eigen::Array2d::Constant(1e9);
  Eigen::Array2d high = -low;
  constexpr std::array<std::array<int, 2>, 4> kAround = {{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d on_table =
        table_from_chart *
        (patch.center_mm + 0.5 * read_mm * Eigen::Vector2d(kAround[i][0], kAround[i][1]));
    places.corners_px[i] = PixelOfTablePoint(camera, {on_table.x(), on_table.y(), 0.0});
    low = low.min(places.corners_px[i].array());
    high = high.max(places.corners_px[i].array());
  }
  const Image<float>& samples = mosaic.samples;
  const Eigen::Isometry2d chart_from_table = table_from_chart.inverse();
  const int left = ClampedTo<int>(std::max(0.0, low.x() - 1.0));
  const int top = ClampedTo<int>(std::max(0.0, low.y() - 1.0));
  const int right = ClampedTo<int>(std::min(samples.width - 1.0, std::ceil(high.x()) + 1.0));
  const int bottom = ClampedTo<int>(std::min(samples.height - 1.0, std::ceil(high.y()) + 1.0));
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const auto on_table = TablePointOfPixel(camera, x, y);
      if (!on_table) {
        continue;
      }
      const Eigen::Array2d place =
          (chart_from_table * Eigen::Vector2d(on_table->head<2>()) - patch.center_mm) / read_mm +
          Eigen::Vector2d::Constant(0.5);  // 0 to 1 within what is read
      if ((place >= 0.0).all() && (place < 1.0).all()) {
        const auto column = static_cast<int>(place.x() * kPatchBlocks);
        const auto row = static_cast<int>(place.y() * kPatchBlocks);
        places.index.push_back(samples.Index(x, y));
        places.sites.colour.push_back(mosaic.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]);
        places.sites.block.push_back(static_cast<uint8_t>(row * kPatchBlocks + column));
      }
    }
  }
  return places;
}

}  // namespace sateen
