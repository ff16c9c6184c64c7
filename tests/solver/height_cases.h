#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/angle.h"
#include "rig/projection.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"

// Reliefs in front of near lights, shaded in closed form at the points where they are.
namespace sateen::testing {

// z = mean + amplitude sin(x) cos(y) + a ripple, and its slopes: a draped cloth with ribs.
struct Drape {
  double mean_mm = 0.0;
  double amplitude_mm = 0.0;
  double ripple_mm = 0.0;

  [[nodiscard]] double At(const Eigen::Vector3d& x) const {
    return mean_mm + amplitude_mm * std::sin(kX * x.x() + 0.5) * std::cos(kY * x.y() + 0.3) +
           ripple_mm * std::sin(kRipple * (x.x() + 0.5 * x.y()));
  }
  [[nodiscard]] Eigen::Vector3d NormalAt(const Eigen::Vector3d& x) const {
    const double rib = ripple_mm * kRipple * std::cos(kRipple * (x.x() + 0.5 * x.y()));
    return Eigen::Vector3d(
               -amplitude_mm * kX * std::cos(kX * x.x() + 0.5) * std::cos(kY * x.y() + 0.3) - rib,
               amplitude_mm * kY * std::sin(kX * x.x() + 0.5) * std::sin(kY * x.y() + 0.3) -
                   0.5 * rib,
               1.0)
        .normalized();
  }

  static constexpr double kX = 2.0 * std::numbers::pi / 160.0;
  static constexpr double kY = 2.0 * std::numbers::pi / 200.0;
  static constexpr double kRipple = 2.0 * std::numbers::pi / 12.0;
};

// Where the ray of pixel (u, v) meets the drape: the distance along it is a contraction.
inline Eigen::Vector3d PointOn(const Drape& drape, const Camera& camera, int u, int v) {
  Eigen::Vector3d x = TablePointOfPixel(camera, u, v).value();
  for (int k = 0; k < 60; ++k) {
    x = TablePointOfPixel(camera, u, v, drape.At(x)).value();
  }
  return x;
}

struct DrapedScene {
  RenderedRelief rendered;
  Image<float> height_mm;
};

// Equation (1) of solver/lambertian.h where the drape is.
inline DrapedScene RenderDrape(const Drape& drape, const Rig& rig) {
  const ImageSize size = rig.camera->size_px;
  DrapedScene scene{{{}, Image3(size), Image3(size)}, Image<float>(size)};
  for (const Light& light : rig.lights) {
    scene.rendered.stack.push_back({.rgb = Image3(size), .name = light.name});
  }
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      const Eigen::Vector3d x = PointOn(drape, *rig.camera, u, v);
      const Eigen::Vector3d n = drape.NormalAt(x);
      const size_t p = scene.height_mm.Index(u, v);
      scene.height_mm.pixels[p] = static_cast<float>(x.z());
      for (size_t c = 0; c < 3; ++c) {
        const auto i = static_cast<Eigen::Index>(c);
        const double rho = 0.4 + 0.1 * static_cast<double>(c) + 0.1 * std::sin(0.1 * u + 0.07 * v);
        scene.rendered.normal[c].pixels[p] = static_cast<float>(n[i]);
        scene.rendered.albedo[c].pixels[p] = static_cast<float>(rho);
        for (size_t k = 0; k < rig.lights.size(); ++k) {
          const Incident in = IncidentAt(rig.lights[k], x);
          scene.rendered.stack[k].rgb[c].pixels[p] =
              static_cast<float>(rho * in.e_rgb[i] * std::max(0.0, n.dot(in.l)));
        }
      }
    }
  }
  return scene;
}

// Ten lights 280 mm away, five of them higher than the others, and a camera at 500 mm that leans.
inline Rig CloseRig(ImageSize size, LightModel model = LightModel::kNear) {
  Rig rig;
  rig.camera = OverheadCamera(size, 500.0, 140.0);
  rig.camera->table_from_camera =
      Eigen::AngleAxisd(8.0 * kRadPerDeg, Eigen::Vector3d::UnitY()) * rig.camera->table_from_camera;
  rig.lights = LedRing(model, 10, 45.0 * kRadPerDeg, 280.0);
  const Lights high = LedRing(model, 10, 25.0 * kRadPerDeg, 280.0);
  for (size_t k = 0; k < rig.lights.size(); k += 2) {
    rig.lights[k] = high[k];
  }
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    rig.lights[k].flux_rgb = Eigen::Vector3d(0.08, 0.075, 0.07);
  }
  return rig;
}

}  // namespace sateen::testing
