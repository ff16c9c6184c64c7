#include "rig/light.h"

#include <algorithm>
#include <cmath>

#include "rig/plausible.h"

namespace sateen {
namespace {

constexpr double kUnitTolerance = 1e-3;  // files often round unit vectors to four digits
constexpr double kMaxAnisotropy = 50.0;  // irradiance halves 9.5 degrees off the axis
constexpr double kReferenceDistanceMm = 1000.0;

bool IsUnit(const Eigen::Vector3d& v) { return std::abs(v.norm() - 1.0) <= kUnitTolerance; }

std::string Show(const Eigen::Vector3d& v) {
  return fmt::format("[{:.6g}, {:.6g}, {:.6g}]", v.x(), v.y(), v.z());
}

}  // namespace

std::string_view Name(LightModel model) {
  switch (model) {
    case LightModel::kDistant:
      return "distant";
    case LightModel::kNear:
      return "near";
    case LightModel::kLed:
      return "led";
    case LightModel::kLedField:
      return "led+field";
  }
  return "";
}

Status Light::Validate(std::string_view what) const {
  if (model == LightModel::kDistant && !IsUnit(direction)) {
    return Fail(ErrorCode::kBadData, "{}: direction {} has length {:.6g}; need a unit vector", what,
                Show(direction), direction.norm());
  }
  if (model != LightModel::kDistant) {
    if (!(position_mm.allFinite() && position_mm.z() > 0.0)) {
      return Fail(ErrorCode::kBadData,
                  "{}: position_mm {}; need finite numbers and z > 0 (the table)", what,
                  Show(position_mm));
    }
    Status place = CheckPlausible(what, ": position_mm: x or y", {position_mm.x(), position_mm.y()},
                                  kPlausiblePlace);
    if (place) {
      place = CheckPlausible(what, ": position_mm: z", {position_mm.z()}, kPlausibleHeight);
    }
    if (!place) {
      return place;
    }
  }
  if (IsLed(model) && !IsUnit(axis)) {
    return Fail(ErrorCode::kBadData, "{}: axis {} has length {:.6g}; need a unit vector", what,
                Show(axis), axis.norm());
  }
  if (IsLed(model) && !(anisotropy >= 0.0 && anisotropy <= kMaxAnisotropy)) {
    return Fail(ErrorCode::kBadData, "{}: anisotropy {:.6g}; need 0 to {:g}", what, anisotropy,
                kMaxAnisotropy);
  }
  if (model == LightModel::kLedField) {
    if (Status status = field.Validate(fmt::format("{}: field", what)); !status) {
      return status;
    }
  }
  if (!(flux_rgb.allFinite() && flux_rgb.minCoeff() > 0.0)) {
    return Fail(ErrorCode::kBadData, "{}: flux_rgb or intensity {}; need three finite numbers > 0",
                what, Show(flux_rgb));
  }
  if (Status flux = CheckPlausible(what, ": flux_rgb or intensity",
                                   {flux_rgb.x(), flux_rgb.y(), flux_rgb.z()}, kPlausibleFlux);
      !flux) {
    return flux;
  }
  if (position_sd_mm && !(position_sd_mm->allFinite() && position_sd_mm->minCoeff() >= 0.0)) {
    return Fail(ErrorCode::kBadData, "{}: position_sd_mm {}; need three finite numbers >= 0", what,
                Show(*position_sd_mm));
  }
  if (position_sd_mm) {
    if (Status sd =
            CheckPlausible(what, ": position_sd_mm", {position_sd_mm->maxCoeff()}, kPlausibleSd);
        !sd) {
      return sd;
    }
  }
  if (direction_sd_deg && !(*direction_sd_deg >= 0.0 && *direction_sd_deg <= 90.0)) {
    return Fail(ErrorCode::kBadData, "{}: direction_sd_deg {:.6g}; need 0 to 90", what,
                *direction_sd_deg);
  }
  if (irradiance_sd && !(*irradiance_sd >= 0.0 && *irradiance_sd <= 1.0)) {
    return Fail(ErrorCode::kBadData, "{}: irradiance_sd {:.6g}; need 0 to 1", what, *irradiance_sd);
  }
  return {};
}

bool AllDistant(const Lights& lights) {
  return std::ranges::all_of(
      lights, [](const Light& light) { return light.model == LightModel::kDistant; });
}

Incident IncidentAt(const Light& light, const Eigen::Vector3d& x_mm) {
  if (light.model == LightModel::kDistant) {
    return {light.direction, light.flux_rgb};  // (1)
  }
  const Eigen::Vector3d d = light.position_mm - x_mm;
  const double distance_mm = d.norm();
  const double falloff = kReferenceDistanceMm / distance_mm;
  Incident incident{d / distance_mm, light.flux_rgb * (falloff * falloff)};  // (2)
  if (IsLed(light.model)) {
    const double cosine = -incident.l.dot(light.axis);
    incident.e_rgb *= cosine > 0.0 ? std::pow(cosine, light.anisotropy) : 0.0;  // (3)
  }
  if (light.model == LightModel::kLedField) {
    incident.e_rgb *= light.field.At(ShadowOnTable(light.position_mm, x_mm));  // (4)
  }
  return incident;
}

}  // namespace sateen
