#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/angle.h"
#include "rig/camera.h"
#include "rig/light.h"
#include "rig/projection.h"
#include "simulation/random.h"

// In a header alone, because tests of modules below cli/ use it too.
namespace sateen {

// Readings of a 14-bit camera from white paper, without pictures: block means with their noise.
struct SyntheticCamera {
  Camera camera;
  int columns = 64;  // blocks
  int rows = 42;
  double full_well_electrons = 47000.0;
  double full_scale = 1.5;  // radiance
  double albedo = 0.99;

  // Sites of one colour in a block; green has twice as many.
  [[nodiscard]] double SitesOfBlock() const {
    return static_cast<double>(camera.size_px.PixelCount()) / (columns * rows) / 4.0;
  }
};

// Returns the normals of a flat sheet and `count` - 1 that rise by ten degrees towards x, y, -x, -y
// and round again.
inline std::vector<Eigen::Vector3d> SheetNormals(int count) {
  std::vector<Eigen::Vector3d> normals = {Eigen::Vector3d::UnitZ()};
  for (int tilt = 1; tilt < count; ++tilt) {
    const double azimuth = 0.5 * std::numbers::pi * (tilt - 1);
    const double slope = 10.0 * kRadPerDeg;
    normals.emplace_back(-std::sin(slope) * std::cos(azimuth), -std::sin(slope) * std::sin(azimuth),
                         std::cos(slope));
  }
  return normals;
}

/// White paper through the table's origin with these normals, under one light, as block means with
/// shot and read noise: what scanner/sessions/sheet_reader.h would read, without pictures. Sheets one after
/// the other, rows from the top; the noise depends on `seed` and the place alone.
inline std::vector<SheetSample> SamplesOn(const std::vector<Eigen::Vector3d>& normals,
                                          const SyntheticCamera& camera, const Light& light,
                                          uint64_t seed) {
  const Eigen::Vector3d eye_mm = camera.camera.table_from_camera.translation();
  std::vector<SheetSample> samples;
  uint64_t counter = 0;
  for (const Eigen::Vector3d& normal : normals) {
    for (int row = 0; row < camera.rows; ++row) {
      for (int column = 0; column < camera.columns; ++column) {
        const double u = (column + 0.5) * camera.camera.size_px.width / camera.columns - 0.5;
        const double v = (row + 0.5) * camera.camera.size_px.height / camera.rows - 0.5;
        const Eigen::Vector3d ray = RayOfPixel(camera.camera, u, v).value();
        SheetSample sample;
        sample.point_mm = eye_mm - ray * (eye_mm.dot(normal) / ray.dot(normal));
        sample.normal = normal;
        const Incident in = IncidentAt(light, sample.point_mm);
        for (Eigen::Index c = 0; c < 3; ++c) {
          const double radiance = camera.albedo * in.e_rgb[c] * std::max(0.0, normal.dot(in.l));
          const double electrons = camera.full_well_electrons * radiance / camera.full_scale;
          const double sites = camera.SitesOfBlock() * (c == 1 ? 2.0 : 1.0);
          sample.sd_rgb[c] = std::sqrt((electrons + 25.0) / sites) / camera.full_well_electrons *
                             camera.full_scale;
          sample.radiance_rgb[c] = radiance + sample.sd_rgb[c] * NormalDeviate(seed, counter++);
        }
        samples.push_back(sample);
      }
    }
  }
  return samples;
}

// On SheetNormals(sheets).
inline std::vector<SheetSample> SamplesOf(const SyntheticCamera& camera, const Light& light,
                                          int sheets, uint64_t seed) {
  return SamplesOn(SheetNormals(sheets), camera, light, seed);
}

}  // namespace sateen
