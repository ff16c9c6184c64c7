#include "calibration/check/check_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace sateen {

namespace {

// Returns height z of equation (2) and its derivatives by u and v.
std::array<double, 3> SheetHeightAt(const SheetHeights& h, double u, double v) {
  return {h[0] + h[1] * u + h[2] * v + h[3] * u * u + h[4] * u * v + h[5] * v * v,
          h[1] + 2.0 * h[3] * u + h[4] * v, h[2] + h[4] * u + 2.0 * h[5] * v};
}

}  // namespace

CheckModel::CheckModel(const Rig& rig, const std::vector<SheetReadings>& sheets, double albedo)
    : rig_(rig), sheets_(sheets), albedo_(albedo) {
  for (const SheetReadings& sheet : sheets) {
    planes_.push_back(PlaneOf(sheet));
  }
}

CheckModel::Plane CheckModel::PlaneOf(const SheetReadings& sheet) {
  Plane plane;
  const auto lit = std::ranges::find_if(sheet.samples, [](const auto& s) { return !s.empty(); });
  if (lit == sheet.samples.end()) {
    return plane;
  }
  plane.normal = lit->front().normal;
  plane.u = (Eigen::Vector3d::UnitX() - plane.normal * plane.normal.x()).normalized();
  plane.v = plane.normal.cross(plane.u);
  plane.middle_mm.setZero();
  for (const SheetSample& sample : *lit) {
    plane.middle_mm += sample.point_mm / static_cast<double>(lit->size());
  }
  for (const SheetSample& sample : *lit) {
    const Eigen::Vector3d off = sample.point_mm - plane.middle_mm;
    plane.half_mm =
        std::max({plane.half_mm, std::abs(off.dot(plane.u)), std::abs(off.dot(plane.v))});
  }
  return plane;
}

RigChange CheckModel::Unchanged() const {
  RigChange change;
  change.lights.resize(rig_.lights.size());
  change.sheets.resize(sheets_.size(), SheetHeights::Zero());
  return change;
}

Eigen::Vector3d CheckModel::Predict(size_t sheet, size_t light, const SheetSample& sample,
                                    const RigChange& change) const {
  return PredictUnder(ChangedLight(rig_.lights[light], change.lights[light]), sheet, sample,
                      change);
}

Eigen::Vector3d CheckModel::PredictUnder(const Light& light, size_t sheet,
                                         const SheetSample& sample, const RigChange& change) const {
  const Plane& plane = planes_[sheet];
  const Eigen::Vector3d eye_mm = rig_.camera->table_from_camera.translation();
  const Eigen::Vector3d was = sample.point_mm - eye_mm;
  const Eigen::Vector3d ray = was + change.camera[3] * Eigen::Vector3d::UnitZ().cross(was);
  const Eigen::Vector3d eye_now_mm = eye_mm + change.camera.head<3>();
  const double along = ray.dot(plane.normal);
  Eigen::Vector3d x = eye_now_mm + ray * ((plane.middle_mm - eye_now_mm).dot(plane.normal) / along);
  const double u = (x - plane.middle_mm).dot(plane.u) / plane.half_mm;
  const double v = (x - plane.middle_mm).dot(plane.v) / plane.half_mm;
  const auto [z, z_u, z_v] = SheetHeightAt(change.sheets[sheet], u, v);
  x += ray * (z / along);
  const Eigen::Vector3d normal =
      (plane.normal - (z_u * plane.u + z_v * plane.v) / plane.half_mm).normalized();
  const Incident in = IncidentAt(light, x);
  return in.e_rgb * (albedo_ * std::max(0.0, normal.dot(in.l)));  // of (1)
}

std::vector<double> CheckModel::Residuals(size_t sheet, size_t light,
                                          const RigChange& change) const {
  std::vector<double> residuals;
  for (const SheetSample& sample : sheets_[sheet].samples[light]) {
    const Eigen::Vector3d off =
        (sample.radiance_rgb - Predict(sheet, light, sample, change)).cwiseQuotient(sample.sd_rgb);
    residuals.insert(residuals.end(), off.begin(), off.end());
  }
  return residuals;
}

void CheckModel::AddReadings(size_t sheet, size_t light, const RigChange& change,
                             const std::vector<double>& weights, const WantedUnknowns& wanted,
                             LocalEquations& equations) const {
  const std::vector<SheetSample>& samples = sheets_[sheet].samples[light];
  const Light now = ChangedLight(rig_.lights[light], change.lights[light]);
  // Rig with one unknown a step higher or lower, two per unknown that is wanted.
  struct Variation {
    int local;
    RigChange change;
    Light light;
  };
  std::vector<Variation> variations;
  for (int local = kMovedAt; local < kLocal; ++local) {
    if (!wanted[static_cast<size_t>(local)]) {
      continue;
    }
    for (const double sign : {1.0, -1.0}) {
      RigChange varied = change;
      UnknownAt(varied, sheet, light, local) += sign * StepOfUnknown(local);
      Light varied_light = ChangedLight(rig_.lights[light], varied.lights[light]);
      variations.push_back({local, std::move(varied), std::move(varied_light)});
    }
  }
  Eigen::Matrix<double, 3, kLocal> jacobian = Eigen::Matrix<double, 3, kLocal>::Zero();
  for (size_t j = 0; j < samples.size(); ++j) {
    if (!(weights[j] > 0.0)) {
      continue;
    }
    const Eigen::Vector3d is = PredictUnder(now, sheet, samples[j], change);
    const Eigen::Array3d scale = samples[j].sd_rgb.array().inverse();
    jacobian.leftCols<3>() = (is.array() * scale).matrix().asDiagonal();
    for (size_t i = 0; i + 1 < variations.size(); i += 2) {
      const Variation& up = variations[i];
      const Variation& down = variations[i + 1];
      jacobian.col(up.local) = ((PredictUnder(up.light, sheet, samples[j], up.change) -
                                 PredictUnder(down.light, sheet, samples[j], down.change))
                                    .array() *
                                scale / (2.0 * StepOfUnknown(up.local)))
                                   .matrix();
    }
    const Eigen::Vector3d off = ((samples[j].radiance_rgb - is).array() * scale).matrix();
    equations.information.noalias() += weights[j] * jacobian.transpose() * jacobian;
    equations.gradient.noalias() += weights[j] * jacobian.transpose() * off;
    equations.cost += weights[j] * off.squaredNorm();
  }
}

WantedUnknowns CheckModel::WantedOf(size_t light, bool moved, bool turned, bool camera,
                                    bool sheet) const {
  WantedUnknowns wanted = {};
  const bool has_axis = IsLed(rig_.lights[light].model);
  for (int local = 0; local < kLocal; ++local) {
    bool is_wanted = sheet;
    if (local < kSheetAt) {
      is_wanted = camera;
    }
    if (local < kCameraAt) {
      is_wanted = turned && has_axis;
    }
    if (local < kTurnedAt) {
      is_wanted = local < kMovedAt || moved;
    }
    wanted[static_cast<size_t>(local)] = is_wanted;
  }
  return wanted;
}

CheckModel::Lie CheckModel::LieOf(size_t sheet, const RigChange& change) const {
  constexpr int kLiePlaces = 5;  // along u and v
  const SheetHeights& h = change.sheets[sheet];
  Lie lie;
  for (int i = 0; i < kLiePlaces * kLiePlaces; ++i) {
    const double u = 2.0 * static_cast<double>(i % kLiePlaces) / (kLiePlaces - 1) - 1.0;
    const double v = 2.0 * std::floor(static_cast<double>(i) / kLiePlaces) / (kLiePlaces - 1) - 1.0;
    const auto [z, z_u, z_v] = SheetHeightAt(h, u, v);
    lie.height_mm = std::max(lie.height_mm, std::abs(z));
    lie.slope_rad =
        std::max(lie.slope_rad, std::atan(std::hypot(z_u, z_v) / planes_[sheet].half_mm));
  }
  return lie;
}

}  // namespace sateen
