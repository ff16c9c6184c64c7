#include "simulation/rigs.h"

#include <cmath>
#include <numbers>

namespace sateen {
namespace {

constexpr int kLedCount = 10;
constexpr double kPolarRad = 45.0 * std::numbers::pi / 180.0;
constexpr double kHemisphereMm = 600.0;
constexpr double kCameraMm = 610.0;

Eigen::Vector3d OnCone(int k, int count, double polar_rad) {
  const double azimuth_rad = 2.0 * std::numbers::pi * k / count;
  return {std::sin(polar_rad) * std::cos(azimuth_rad), std::sin(polar_rad) * std::sin(azimuth_rad),
          std::cos(polar_rad)};
}

}  // namespace

Lights DistantRing(int count, double polar_rad) {
  Lights lights;
  for (int k = 0; k < count; ++k) {
    lights.push_back({.name = fmt::format("light-{}", k),
                      .channel = k,
                      .direction = OnCone(k, count, polar_rad)});
  }
  return lights;
}

Lights LedRing(LightModel model, int count, double polar_rad, double radius_mm) {
  Lights lights;
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector3d direction = OnCone(k, count, polar_rad);
    lights.push_back({.name = fmt::format("led-{}", k),
                      .channel = k,
                      .model = model,
                      .position_mm = radius_mm * direction,
                      .axis = -direction,
                      .anisotropy = model == LightModel::kLed ? 1.0 : 0.0});
  }
  return lights;
}

Rig RingRig(ImageSize size_px, LightModel model, double width_mm) {
  Rig rig;
  rig.camera = OverheadCamera(size_px, kCameraMm, width_mm);
  if (model == LightModel::kDistant) {
    rig.lights = DistantRing(kLedCount, kPolarRad);
    return rig;
  }
  rig.lights = LedRing(model, kLedCount, kPolarRad, kHemisphereMm);
  for (Light& light : rig.lights) {
    light.flux_rgb *= std::pow(kHemisphereMm / 1000.0, 2);
  }
  return rig;
}

}  // namespace sateen
