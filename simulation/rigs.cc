#include "simulation/rigs.h"

#include <cmath>
#include <numbers>

#include "rig/projection.h"

namespace sateen {
namespace {

constexpr int kLedCount = 10;
constexpr double kPolarRad = 45.0 * std::numbers::pi / 180.0;
constexpr double kHemisphereMm = 600.0;
constexpr double kCameraMm = 610.0;
constexpr double kRingAmplitude = 0.03;
constexpr double kFirstRingMm = 120.0;
constexpr double kRingStepMm = 5.0;

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

GainField LensRings(const Eigen::Vector2d& centre_mm, double amplitude, double period_mm) {
  constexpr int kKnots = 29;
  constexpr double kSpacingMm = 20.0;
  constexpr double kFadeMm = 150.0;
  GainField field{.origin_mm = centre_mm.array() - 0.5 * (kKnots - 1) * kSpacingMm,
                  .spacing_mm = kSpacingMm,
                  .columns = kKnots,
                  .rows = kKnots};
  for (int r = 0; r < kKnots; ++r) {
    for (int c = 0; c < kKnots; ++c) {
      const double radius_mm =
          (field.origin_mm + kSpacingMm * Eigen::Vector2d(c, r) - centre_mm).norm();
      field.gain.push_back(1.0 + amplitude *
                                     std::cos(2.0 * std::numbers::pi * radius_mm / period_mm) *
                                     std::exp(-std::pow(radius_mm / kFadeMm, 2)));
    }
  }
  return field;
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
                      .anisotropy = IsLed(model) ? 1.0 : 0.0});
    if (model == LightModel::kLedField) {
      lights.back().field =
          LensRings(Eigen::Vector2d::Zero(), kRingAmplitude, kFirstRingMm + kRingStepMm * k);
    }
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
