#include "calibration/print/border_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "calibration/print/markers.h"
#include "calibration/print/plane_map.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr double kWhiteShare = 0.9;  // of the pixels are darker than this, which becomes 230
constexpr double kWhiteLevel = 230.0;

Image<uint8_t> GreyOf(const Image<float>& picture) {
  std::vector<float> sorted = picture.pixels;
  const auto white = sorted.begin() +
                     static_cast<std::ptrdiff_t>(kWhiteShare * static_cast<double>(sorted.size()));
  std::nth_element(sorted.begin(), white, sorted.end());
  const double scale = *white > 0.0F ? kWhiteLevel / static_cast<double>(*white) : 0.0;
  Image<uint8_t> grey(picture.Size());
  for (size_t i = 0; i < grey.pixels.size(); ++i) {
    const double level = scale * static_cast<double>(picture.pixels[i]);
    grey.pixels[i] = static_cast<uint8_t>(std::lround(std::clamp(level, 0.0, 255.0)));
  }
  return grey;
}

}  // namespace

BorderView LookForBorder(const Image<float>& picture, const Camera& camera,
                         const SheetBorder& border) {
  Camera straight = camera;
  straight.distortion = {};
  const std::vector<Eigen::Vector3d> centers = border.MarkerCenters();
  const double half = 0.5 * border.marker_mm;
  BorderView view;
  for (const MarkerView& marker : FindMarkers(GreyOf(picture), border.dictionary)) {
    ++view.seen;
    std::array<Eigen::Vector2d, 4> straightened;
    bool known = static_cast<size_t>(marker.id) < centers.size();
    for (size_t c = 0; c < 4 && known; ++c) {
      const Eigen::Vector2d& px = marker.corners_px[c];
      const auto ray = RayOfPixel(camera, px.x(), px.y());
      known = ray.has_value();
      if (known) {
        straightened[c] =
            PixelOfTablePoint(straight, camera.table_from_camera.translation() + *ray);
      }
    }
    if (!known) {
      continue;
    }
    const Eigen::Vector3d& center = centers[static_cast<size_t>(marker.id)];
    view.ids.push_back(marker.id);
    for (const auto& [x, y] : {std::pair(-1, 1), {1, 1}, {1, -1}, {-1, -1}}) {
      view.points_mm.emplace_back(center + half * Eigen::Vector3d(x, y, 0.0));
    }
    view.corners_px.insert(view.corners_px.end(), marker.corners_px.begin(),
                           marker.corners_px.end());
    view.straight_px.insert(view.straight_px.end(), straightened.begin(), straightened.end());
  }
  return view;
}

BorderView InPlace(const BorderView& view, double slack_px) {
  const std::optional<PlaneMap> map = FitPlaneMap(view.points_mm, view.straight_px, slack_px);
  BorderView kept = {.seen = view.seen};
  for (size_t i = 0; i < view.ids.size() && map; ++i) {
    bool near = true;
    for (size_t c = 4 * i; c < 4 * i + 4; ++c) {
      const Eigen::Vector2d at = MapPoint(*map, view.points_mm[c].head<2>());
      near = near && (at - view.straight_px[c]).norm() <= slack_px;
    }
    if (!near) {
      continue;
    }
    kept.ids.push_back(view.ids[i]);
    for (size_t c = 4 * i; c < 4 * i + 4; ++c) {
      kept.points_mm.push_back(view.points_mm[c]);
      kept.corners_px.push_back(view.corners_px[c]);
      kept.straight_px.push_back(view.straight_px[c]);
    }
  }
  return kept;
}

}  // namespace sateen
