#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "core/check.h"
#include "core/parallel.h"
#include "imaging/image.h"
#include "imaging/image_io.h"
#include "rig/camera.h"
#include "rig/projection.h"
#include "simulation/random.h"
#include "targets/print.h"

namespace sateen::testing {

// An 8-bit file as grey levels, as they are in the file.
inline Image<uint8_t> GreyFile(const std::filesystem::path& path) {
  const Photo photo = ReadPhoto(path, Encoding::kLinear).value();
  Image<uint8_t> grey(photo.rgb.Size());
  for (size_t i = 0; i < grey.pixels.size(); ++i) {
    grey.pixels[i] = static_cast<uint8_t>(std::lround(255.0F * photo.rgb[1].pixels[i]));
  }
  return grey;
}

// Renders a plane whose print is `white_at` (in its millimetres), 0 to 1, through the lens: 34 rays
// per pixel, in a Fibonacci lattice, whose shadow on each side has 34 places too, so that edges
// along the rows come out as smooth as others; and noise of `noise_dn` grey levels. Where the rays
// meet the plane is interpolated between the pixel's corners, which no lens bends enough to be
// seen.
inline Image<uint8_t> PictureOf(const Camera& lens, const Eigen::Isometry3d& camera_from_plane,
                                const std::function<double(double, double)>& white_at,
                                uint64_t seed, double noise_dn = 2.0) {
  constexpr int kRays = 34;
  constexpr int kStride = 21;
  Camera camera = lens;
  camera.table_from_camera = camera_from_plane.inverse();
  Image<uint8_t> grey(lens.size_px);
  const auto corners_of = [&](int y) {
    std::vector<std::optional<Eigen::Vector3d>> corners;
    for (int x = 0; x <= grey.width; ++x) {
      corners.push_back(TablePointOfPixel(camera, x - 0.5, y - 0.5));
    }
    return corners;
  };
  const auto draw_row = [&](int y) {
    const auto above = corners_of(y);
    const auto below = corners_of(y + 1);
    for (size_t x = 0; x + 1 < above.size(); ++x) {
      double sum = 0.5 * kRays;  // where the plane is not seen
      if (above[x] && above[x + 1] && below[x] && below[x + 1]) {
        sum = 0.0;
        for (int ray = 0; ray < kRays; ++ray) {
          const double u = (ray + 0.5) / kRays;
          const double v = (ray * kStride % kRays + 0.5) / kRays;
          const Eigen::Vector3d at = (1.0 - v) * ((1.0 - u) * *above[x] + u * *above[x + 1]) +
                                     v * ((1.0 - u) * *below[x] + u * *below[x + 1]);
          sum += white_at(at.x(), at.y());
        }
      }
      const size_t pixel = grey.Index(static_cast<int>(x), y);
      const double level = 30.0 + 190.0 * sum / kRays + noise_dn * NormalDeviate(seed, pixel);
      grey.pixels[pixel] = static_cast<uint8_t>(std::lround(std::clamp(level, 0.0, 255.0)));
    }
  };
  const Status drawn = ParallelFor(grey.height, 8, {}, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      draw_row(y);
    }
  });
  SATEEN_CHECK(drawn.has_value());
  return grey;
}

// 1 where the print is white.
inline std::function<double(double, double)> WhiteOf(const BoardSpec& spec) {
  return [print = PrintOf(spec)](double x, double y) {
    return print.IsBlackAt({x, y}) ? 0.0 : 1.0;
  };
}

}  // namespace sateen::testing
