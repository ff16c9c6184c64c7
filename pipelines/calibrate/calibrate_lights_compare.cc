#include "pipelines/calibrate/calibrate_lights_compare.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "calibration/lights/seed_procedure.h"
#include "calibration/sheet/flatness.h"
#include "core/angle.h"

namespace sateen {
namespace {

constexpr int kHandfulOfRounds = 5;  // "We can repeat this process a handful of times"

// Light k at sample i of a sheet.
using WayIncident = std::function<Incident(const Sheet& sheet, size_t light, size_t sample)>;

class Comparison {
 public:
  Comparison(const std::vector<Sheet>& sheets, const Lights& truth, double albedo)
      : sheets_(sheets), rough_(sheets[0].rig.lights), truth_(truth), albedo_(albedo) {}

  [[nodiscard]] WayFigures Ruler() const {
    std::vector<Eigen::Vector3d> intensity;
    for (size_t k = 0; k < rough_.size(); ++k) {
      intensity.push_back(IntensityAtCentre(sheets_[0].samples[k], rough_[k].position_mm, albedo_));
    }
    return Judge("ruler", "ruler, one intensity a light", rough_,
                 [&](const Sheet& sheet, size_t k, size_t i) {
                   const Eigen::Vector3d d = rough_[k].position_mm - sheet.samples[k][i].point_mm;
                   return Incident{d.normalized(), intensity[k]};
                 });
  }

  [[nodiscard]] WayFigures RulerWithFallOff() const {
    Lights lights = rough_;
    for (size_t k = 0; k < lights.size(); ++k) {
      // IncidentAt() at the origin gives, for this flux, the intensity measured there.
      lights[k].flux_rgb.setOnes();
      const Eigen::Vector3d unit = IncidentAt(lights[k], Eigen::Vector3d::Zero()).e_rgb;
      lights[k].flux_rgb = IntensityAtCentre(sheets_[0].samples[k], lights[k].position_mm, albedo_)
                               .cwiseQuotient(unit);
    }
    return Fitted("ruler_fall_off", "ruler, fall-off over distance", lights);
  }

  [[nodiscard]] WayFigures Procedure(std::string key, std::string label,
                                     const SeedProcedureOptions& options) const {
    std::vector<SeedLight> found;
    Lights lights = rough_;
    for (size_t k = 0; k < rough_.size(); ++k) {
      const Sheet& flat = sheets_[0];
      Result<SeedLight> light =
          CalibrateBySeedProcedure(flat.samples[k], flat.blocks[k], flat.grid.columns,
                                   flat.grid.rows, rough_[k].position_mm, options);
      if (!light) {
        return {.key = std::move(key), .label = std::move(label)};
      }
      lights[k].position_mm = light->position_mm;
      found.push_back(*std::move(light));
    }
    return Judge(std::move(key), std::move(label), lights,
                 [&](const Sheet& sheet, size_t k, size_t i) {
                   return IncidentAt(found[k], sheet.blocks[k][i], sheet.samples[k][i].point_mm);
                 });
  }

  [[nodiscard]] WayFigures Fitted(std::string key, std::string label, const Lights& lights) const {
    return Judge(std::move(key), std::move(label), lights,
                 [&](const Sheet& sheet, size_t k, size_t i) {
                   return IncidentAt(lights[k], sheet.samples[k][i].point_mm);
                 });
  }

 private:
  [[nodiscard]] WayFigures Judge(std::string key, std::string label, const Lights& lights,
                                 const WayIncident& incident) const {
    WayFigures figures{.key = std::move(key), .label = std::move(label)};
    for (size_t s = 0; s < sheets_.size(); ++s) {
      const Sheet& sheet = sheets_[s];
      const Result<Flatness> flatness =
          FlatnessOf({.columns = sheet.grid.columns,
                      .rows = sheet.grid.rows,
                      .samples = sheet.samples,
                      .blocks = sheet.blocks},
                     [&](size_t k, size_t i) { return incident(sheet, k, i); });
      if (!flatness) {
        return figures;
      }
      const double worst_deg = flatness->worst_rad / kRadPerDeg;
      if (s == 0) {
        figures.flat_deg = worst_deg;
      } else {
        figures.tilted_deg = std::max(figures.tilted_deg.value_or(0.0), worst_deg);
      }
    }
    for (size_t k = 0; k < lights.size(); ++k) {
      const auto truth = std::ranges::find(truth_, lights[k].name, &Light::name);
      if (truth != truth_.end()) {
        figures.direction_error_deg =
            std::max(figures.direction_error_deg.value_or(0.0),
                     DirectionErrorDeg(lights[k], *truth, sheets_[0].samples[k]));
      }
    }
    return figures;
  }

  const std::vector<Sheet>& sheets_;
  const Lights& rough_;
  const Lights& truth_;
  double albedo_;
};

}  // namespace

double DirectionErrorDeg(const Light& a, const Light& b, const std::vector<SheetSample>& samples) {
  double worst = 0.0;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector3d la = IncidentAt(a, sample.point_mm).l;
    const Eigen::Vector3d lb = IncidentAt(b, sample.point_mm).l;
    worst = std::max(worst, AngleBetweenRad(la, lb));
  }
  return worst / kRadPerDeg;
}

std::vector<WayFigures> CompareWays(const std::vector<Sheet>& sheets, const Lights& fitted,
                                    const Lights& truth, double albedo) {
  const Comparison comparison(sheets, truth, albedo);
  return {comparison.Ruler(), comparison.RulerWithFallOff(),
          comparison.Procedure("order_1886_equation", "The Order: 1886, its equation",
                               {.albedo = albedo, .most_rounds = kHandfulOfRounds}),
          comparison.Procedure("order_1886_fall_off", "The Order: 1886, read kindly",
                               {.albedo = albedo, .direction_step = DirectionStep::kFallOff}),
          comparison.Fitted("fit", "this fit", fitted)};
}

}  // namespace sateen
