#include "simulation/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/check.h"

namespace sateen {
namespace {

constexpr double kPatchGround = 0.18;
constexpr double kSteepest = 100.0;  // beyond it rays take too many steps to be followed
constexpr double kLeastLength_mm = 1e-3;
constexpr double kMostLight = 1e6;  // irradiance, or flux

[[nodiscard]] tl::unexpected<Error> BadValue(std::string_view key, double value,
                                             std::string_view range) {
  return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", key, value, range);
}

Status CheckLength(std::string_view key, double value_mm) {
  if (!(value_mm >= kLeastLength_mm && value_mm <= 1.0 / kLeastLength_mm / kLeastLength_mm)) {
    return BadValue(key, value_mm, "0.001 to 1e6");
  }
  return {};
}

bool IsFraction(double value) { return value >= 0.0 && value <= 1.0; }

Eigen::Vector3d Evaluated(const ConstantAlbedo& albedo, double /*x*/, double /*y*/) {
  return albedo.rgb;
}

Eigen::Vector3d Evaluated(const WavyAlbedo& albedo, double x, double y) {
  const double k = 2.0 * std::numbers::pi / albedo.period_mm;
  const Eigen::Array3d phase(k * (x + y), k * (x - y) + 2.0, k * y + 4.0);
  return albedo.min + (albedo.max - albedo.min) * (0.5 + 0.5 * phase.sin());
}

Eigen::Vector3d Evaluated(const PrintAlbedo& albedo, double x, double y) {
  // The point of the print's plane over (x, y): p = R q + t with q.z = 0, of which x and y do.
  const Eigen::Matrix3d& r = albedo.table_from_print.linear();
  const Eigen::Vector2d from_origin =
      Eigen::Vector2d(x, y) - albedo.table_from_print.translation().head<2>();
  const Eigen::Vector2d q = r.topLeftCorner<2, 2>().inverse() * from_origin;
  if (albedo.beyond && !albedo.print.Covers(q)) {
    return Eigen::Vector3d::Constant(*albedo.beyond);
  }
  return Eigen::Vector3d::Constant(albedo.print.IsBlackAt(q) ? albedo.dark : albedo.light);
}

Eigen::Vector3d Evaluated(const PatchesAlbedo& albedo, double x, double y) {
  const auto count = static_cast<double>(albedo.values.size());
  const double patch = std::floor(x / albedo.patch_mm + 0.5 * count);
  const bool inside = patch >= 0.0 && patch < count && std::abs(y) < 0.5 * albedo.patch_mm;
  return Eigen::Vector3d::Constant(inside ? albedo.values[static_cast<size_t>(patch)]
                                          : kPatchGround);
}

Status CheckAlbedo(const ConstantAlbedo& albedo) {
  for (const double value : albedo.rgb) {
    if (!IsFraction(value)) {
      return BadValue("albedo", value, "0 to 1");
    }
  }
  return {};
}

Status CheckAlbedo(const WavyAlbedo& albedo) {
  if (!(albedo.min >= 0.0 && albedo.min <= albedo.max)) {
    return BadValue("texture.min", albedo.min, "0 <= min <= max");
  }
  if (!(albedo.max <= 1.0)) {
    return BadValue("texture.max", albedo.max, "max <= 1");
  }
  return CheckLength("texture.period_mm", albedo.period_mm);
}

Status CheckAlbedo(const PrintAlbedo& albedo) {
  if (!IsFraction(albedo.dark)) {
    return BadValue("texture.dark", albedo.dark, "0 to 1");
  }
  if (!IsFraction(albedo.light)) {
    return BadValue("texture.light", albedo.light, "0 to 1");
  }
  if (albedo.beyond && !IsFraction(*albedo.beyond)) {
    return BadValue("texture.beyond", *albedo.beyond, "0 to 1");
  }
  return {};
}

Status CheckAlbedo(const PatchesAlbedo& albedo) {
  if (albedo.values.empty()) {
    return BadValue("texture.count", 0.0, "1 or more");
  }
  if (Status status = CheckLength("texture.patch_mm", albedo.patch_mm); !status) {
    return status;
  }
  for (const double value : albedo.values) {
    if (!IsFraction(value)) {
      return BadValue("texture.values", value, "0 to 1 each");
    }
  }
  return {};
}

Status CheckIllumination(const Illumination& illumination) {
  if (illumination.shadow_samples < 1 || illumination.shadow_samples > 16) {
    return BadValue("illumination.shadow_samples", illumination.shadow_samples, "1 to 16");
  }
  if (illumination.bounce_rays < 0 || illumination.bounce_rays > 65536) {
    return BadValue("illumination.bounce_rays", illumination.bounce_rays, "0 to 65536");
  }
  for (const double value : illumination.ambient_rgb) {
    if (!(value >= 0.0 && value <= kMostLight)) {
      return BadValue("illumination.ambient_rgb", value, "0 to 1e6 each");
    }
  }
  if (!(illumination.flicker >= 0.0 && illumination.flicker <= 0.2)) {
    return BadValue("illumination.flicker", illumination.flicker, "0 to 0.2");
  }
  return {};
}

Status CheckLens(const Lens& lens) {
  for (int i = 0; i <= 100; ++i) {
    const double r2 = i / 100.0;
    const auto [v1, v2, v3] = lens.vignetting;
    const double gain = 1.0 + r2 * (v1 + r2 * (v2 + r2 * v3));
    if (!(gain > 0.0 && gain <= 4.0)) {
      return BadValue("lens.vignetting", gain,
                      "a gain of more than 0 and at most 4 from the centre to the corner");
    }
  }
  if (!(lens.psf_sigma_px >= 0.0 && lens.psf_sigma_px <= 20.0)) {
    return BadValue("lens.psf_sigma_px", lens.psf_sigma_px, "0 to 20");
  }
  if (lens.samples < 1 || lens.samples > 16) {
    return BadValue("lens.samples", lens.samples, "1 to 16");
  }
  if (!(lens.bump_px.cwiseAbs().maxCoeff() <= 1000.0)) {
    return BadValue("lens.bump.shift_px", lens.bump_px.cwiseAbs().maxCoeff(), "-1000 to 1000");
  }
  return {};
}

Status CheckAbove(const Surface& surface, std::string_view what, const Eigen::Vector3d& at_mm) {
  const double height_mm = surface.At(at_mm.x(), at_mm.y()).height_mm;
  const double highest_mm = std::isfinite(surface.HighestMm()) ? surface.HighestMm() : height_mm;
  if (!(at_mm.z() > std::max(height_mm, highest_mm))) {
    return Fail(ErrorCode::kInvalidArgument,
                "{} is at z = {:g} mm, inside or below the sample; need more than {:g} mm", what,
                at_mm.z(), std::max(height_mm, highest_mm));
  }
  return {};
}

Status CheckPlaces(const Rig& rig, const Surface& surface) {
  Status status = CheckAbove(surface, "the camera", rig.camera->table_from_camera.translation());
  for (const Light& light : rig.lights) {
    if (status && !(light.flux_rgb.maxCoeff() <= kMostLight)) {
      return Fail(ErrorCode::kInvalidArgument, "light '{}': flux_rgb = {:g}; need at most {:g}",
                  light.name, light.flux_rgb.maxCoeff(), kMostLight);
    }
    if (status && light.model != LightModel::kDistant) {
      status = CheckAbove(surface, "light '" + light.name + "'", light.position_mm);
    }
  }
  return status;
}

Status CheckLightName(const Lights& lights, std::string_view key, const std::string& name) {
  if (std::ranges::find(lights, name, &Light::name) != lights.end()) {
    return {};
  }
  std::vector<std::string> names;
  names.reserve(lights.size());
  for (const Light& light : lights) {
    names.push_back(light.name);
  }
  return Fail(ErrorCode::kInvalidArgument, "{}: '{}' is no light of the rig; need one of {}", key,
              name, fmt::join(names, ", "));
}

Status CheckLightNames(const Scene& scene) {
  for (const std::string& name : scene.illumination.dead) {
    if (Status status = CheckLightName(scene.rig.lights, "illumination.dead", name); !status) {
      return status;
    }
  }
  return scene.lens.bump_from.empty()
             ? Status()
             : CheckLightName(scene.rig.lights, "lens.bump.from", scene.lens.bump_from);
}

Status CheckMaterial(const Material& material) {
  if (!(material.yarn_variation >= 0.0 && material.yarn_variation < 1.0)) {
    return BadValue("yarn_variation", material.yarn_variation, "0 to below 1");
  }
  return std::visit([](const auto& kind) { return CheckAlbedo(kind); }, material.albedo);
}

}  // namespace

Eigen::Vector3d AlbedoAt(const Albedo& albedo, double x_mm, double y_mm) {
  return std::visit([&](const auto& kind) { return Evaluated(kind, x_mm, y_mm); }, albedo);
}

Status Scene::Validate() const {
  SATEEN_CHECK(surface != nullptr && materials.size() == surface->Parts().size());
  if (Status status = rig.Validate("rig"); !status) {
    return status;
  }
  if (!rig.camera) {
    return Fail(ErrorCode::kInvalidArgument, "the rig has no camera; need one, for the frames");
  }
  if (!rig.camera->has_pose) {
    return Fail(ErrorCode::kInvalidArgument,
                "the rig's camera has no table_from_camera; need it, for the frames");
  }
  if (rig.lights.empty()) {
    return Fail(ErrorCode::kInvalidArgument, "the rig has no lights; need one, for the frames");
  }
  if (!(surface->MaxSlope() <= kSteepest)) {
    return Fail(ErrorCode::kInvalidArgument,
                "surface rises by {:g} mm a millimetre somewhere; need at most {:g}, which is 89.4 "
                "degrees",
                surface->MaxSlope(), kSteepest);
  }
  const std::vector<std::string_view> parts = surface->Parts();
  for (size_t i = 0; i < parts.size(); ++i) {
    if (const Status status = CheckMaterial(materials[i]); !status) {
      return Fail(status.error().code, "materials.{}.{}", parts[i], status.error().message);
    }
  }
  return CheckIllumination(illumination)
      .and_then([&] { return CheckLens(lens); })
      .and_then([&] { return CheckPlaces(rig, *surface); })
      .and_then([&] { return CheckLightNames(*this); });
}

}  // namespace sateen
