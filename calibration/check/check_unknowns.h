#pragma once

#include <Eigen/Geometry>
#include <array>
#include <utility>

#include "calibration/check/check_system.h"
#include "core/angle.h"

// What the parts of CheckSystem agree on: where its unknowns are, and what each does.
namespace sateen {

// Where the unknowns of one light and sheet are.
inline constexpr int kFluxAt = 0;
inline constexpr int kMovedAt = 3;
inline constexpr int kTurnedAt = 6;
inline constexpr int kCameraAt = 8;
inline constexpr int kSheetAt = 12;

inline constexpr double kDifferenceMm = 0.01;  // of the central differences
inline constexpr double kDifferenceRad = 1e-5;
inline constexpr double kFluxPrior = 3.0;  // standard deviations of what is likely
inline constexpr double kMovedPriorMm = 100.0;
inline constexpr double kTurnedPriorRad = 20.0 * kRadPerDeg;
inline constexpr double kCameraPriorMm = 50.0;
inline constexpr double kCameraPriorRad = 5.0 * kRadPerDeg;
inline constexpr double kSheetPriorMm = 5.0;

inline double PriorOfUnknown(int local) {
  if (local < kMovedAt) {
    return kFluxPrior;
  }
  if (local < kTurnedAt) {
    return kMovedPriorMm;
  }
  if (local < kCameraAt) {
    return kTurnedPriorRad;
  }
  if (local < kSheetAt) {
    return local == kSheetAt - 1 ? kCameraPriorRad : kCameraPriorMm;
  }
  return kSheetPriorMm;
}

inline double StepOfUnknown(int local) {
  const bool is_angle = (local >= kTurnedAt && local < kCameraAt) || local == kSheetAt - 1;
  return is_angle ? kDifferenceRad : kDifferenceMm;
}

// The unknown `local` of one light and sheet.
inline double& UnknownAt(RigChange& change, size_t sheet, size_t light, int local) {
  if (local < kMovedAt) {
    return change.lights[light].log_flux[local];
  }
  if (local < kTurnedAt) {
    return change.lights[light].moved_mm[local - kMovedAt];
  }
  if (local < kCameraAt) {
    return change.lights[light].turned_rad[local - kTurnedAt];
  }
  return local < kSheetAt ? change.camera[local - kCameraAt]
                          : change.sheets[sheet][local - kSheetAt];
}

// Two unit vectors across another.
inline std::pair<Eigen::Vector3d, Eigen::Vector3d> AcrossAxis(const Eigen::Vector3d& axis) {
  const Eigen::Vector3d a = axis.unitOrthogonal();
  return {a, axis.cross(a)};
}

inline Light ChangedLight(const Light& light, const LightChange& change) {
  Light now = light;
  now.position_mm += change.moved_mm;
  now.field.origin_mm += change.moved_mm.head<2>();  // its gains go with the lamp
  const auto [a, b] = AcrossAxis(light.axis);
  now.axis = (light.axis + change.turned_rad[0] * a + change.turned_rad[1] * b).normalized();
  now.flux_rgb.array() *= change.log_flux.array().exp();
  return now;
}

// z of (2) and its derivatives.
inline std::array<double, 3> SheetHeightAt(const SheetHeights& h, double u, double v) {
  return {h[0] + h[1] * u + h[2] * v + h[3] * u * u + h[4] * u * v + h[5] * v * v,
          h[1] + 2.0 * h[3] * u + h[4] * v, h[2] + h[4] * u + 2.0 * h[5] * v};
}

}  // namespace sateen
