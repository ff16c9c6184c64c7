#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

#include "imaging/image.h"
#include "imaging/image_io.h"
#include "rig/camera.h"
#include "simulation/random.h"

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

// What the lens sees of a plane whose print `white_at` (in its millimetres) says 0 to 1: 5 x 5 rays
// a pixel, and noise of two grey levels.
inline Image<uint8_t> PictureOf(const Camera& lens, const Eigen::Isometry3d& camera_from_plane,
                                const std::function<double(double, double)>& white_at,
                                uint64_t seed) {
  constexpr int kRays = 5;
  Camera camera = lens;
  camera.table_from_camera = camera_from_plane.inverse();
  Image<uint8_t> grey(lens.size_px);
  for (int y = 0; y < grey.height; ++y) {
    for (int x = 0; x < grey.width; ++x) {
      double sum = 0.0;
      for (int ray = 0; ray < kRays * kRays; ++ray) {
        const double u = x + (ray % kRays + 0.5) / kRays - 0.5;
        const double v = y + (ray / kRays + 0.5) / kRays - 0.5;
        const auto at = TablePointOfPixel(camera, u, v);
        sum += at ? white_at(at->x(), at->y()) : 0.5;
      }
      const double level =
          30.0 + 190.0 * sum / (kRays * kRays) + 2.0 * NormalDeviate(seed, grey.Index(x, y));
      grey.At(x, y) = static_cast<uint8_t>(std::lround(std::clamp(level, 0.0, 255.0)));
    }
  }
  return grey;
}

}  // namespace sateen::testing
