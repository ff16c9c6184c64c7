#include "pipelines/calibrate/spheres_record.h"

#include <cmath>

#include "core/angle.h"

namespace sateen {
namespace {

SphereRecord RecordOf(const Sphere& sphere, bool has_depth) {
  SphereRecord record{.center_px = sphere.outline.center_px,
                      .radius_px = sphere.outline.radius_px,
                      .outline_seen = sphere.seen,
                      .outline_rms_px = sphere.residual_px};
  if (has_depth) {
    record.center_mm = sphere.center;
  }
  return record;
}

LampRecord RecordOf(const LampFigures& figures) {
  const Light& light = figures.lamp.light;
  const SkyPlace place = PlaceInSky(figures.Direction());
  LampRecord record{.name = light.name,
                    .file = figures.file.string(),
                    .model = std::string(Name(light.model)),
                    .direction = figures.Direction(),
                    .elevation_deg = place.elevation_deg,
                    .azimuth_deg = place.azimuth_deg,
                    .spheres = figures.spheres_used};
  std::vector<std::optional<Eigen::Vector2d>>& highlights_px = record.highlights_px.emplace();
  for (const std::optional<Highlight>& highlight : figures.highlights) {
    highlights_px.push_back(highlight ? std::optional(highlight->at_px) : std::nullopt);
  }
  if (figures.spheres_used > 1) {
    record.disagreement_deg = figures.lamp.residual_rad / kRadPerDeg;
  }
  if (figures.lamp.position_sd_mm) {
    record.position_mm = light.position_mm;
    record.position_sd_mm = figures.lamp.position_sd_mm;
  }
  return record;
}

}  // namespace

SkyPlace PlaceInSky(const Eigen::Vector3d& l) {
  const double azimuth_deg = std::atan2(l.y(), l.x()) / kRadPerDeg;
  return {std::asin(l.z()) / kRadPerDeg, azimuth_deg < 0.0 ? azimuth_deg + 360.0 : azimuth_deg};
}

SpheresRecord RecordOf(const CalibrateSpheresOptions& options, const SpheresCalibration& result) {
  const bool has_camera = result.rig.camera.has_value();
  SpheresRecord record;
  FillCommon("spheres", result, record);
  record.projection = has_camera ? "perspective" : "orthographic";
  record.highlight = std::string(Name(options.highlight));
  record.outlines = result.outlines;
  if (options.radius_mm > 0.0) {
    record.radius_mm = options.radius_mm;
  }
  std::vector<SphereRecord>& spheres = record.spheres.emplace();
  for (const Sphere& sphere : result.spheres) {
    spheres.push_back(RecordOf(sphere, has_camera && options.radius_mm > 0.0));
  }
  std::vector<LampRecord>& lights = record.lights.emplace();
  for (const LampFigures& figures : result.lights) {
    lights.push_back(RecordOf(figures));
  }
  return record;
}

}  // namespace sateen
