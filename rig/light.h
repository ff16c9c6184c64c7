#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rig/gain_field.h"

namespace sateen {

// The rungs of the model ladder (docs/concepts.md); each adds to the one above.
enum class LightModel { kDistant, kNear, kLed, kLedField };

[[nodiscard]] std::string_view Name(LightModel model);
// Has an axis and a fall-off.
[[nodiscard]] constexpr bool IsLed(LightModel model) { return model >= LightModel::kLed; }

// One LED as a plain value, in the table frame. Which fields count depends on `model`.
struct Light {
  std::string name;
  int channel = 0;  // channel of the LED board
  LightModel model = LightModel::kDistant;
  // kDistant: unit vector from the table towards the light.
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  // kNear and above: where the light is.
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  // kLed and above: unit vector along which it shines, and the exponent mu of its angular
  // fall-off, 0 to 50.
  Eigen::Vector3d axis = -Eigen::Vector3d::UnitZ();
  double anisotropy = 0.0;
  // kLedField: what the led's law is multiplied by, over the table.
  GainField field;
  // kDistant: irradiance; otherwise the irradiance at 1 m on the axis. Red, green, blue; > 0.
  Eigen::Vector3d flux_rgb = Eigen::Vector3d::Ones();
  // Standard deviations, where a calibration found them, all >= 0: along the table's axes (kNear
  // and above); of the angle to the true direction (kDistant), root mean square; of the irradiance
  // in the middle of the table, relative, with the covariance of flux and position.
  std::optional<Eigen::Vector3d> position_sd_mm;
  std::optional<double> direction_sd_deg;
  std::optional<double> irradiance_sd;

  // Names the first field that is out of range, with its value and its range. `what` names the
  // light in the message ("lights.txt: light 3").
  [[nodiscard]] Status Validate(std::string_view what) const;

  bool operator==(const Light&) const = default;
};

using Lights = std::vector<Light>;

// Returns whether no light is near.
[[nodiscard]] bool AllDistant(const Lights& lights);

// Light that arrives at one point from one light.
struct Incident {
  Eigen::Vector3d l;      // unit vector towards the light
  Eigen::Vector3d e_rgb;  // irradiance on a surface that faces the light
};

/// Returns the light that arrives at point x of the table frame, in millimetres:
///
///     distant   l constant,                e = phi                                        (1)
///     near      d = s - x, l = d / |d|,    e = phi (1000 mm / |d|)^2                      (2)
///     led       as near, and               e = (2) * (-l . a)^mu, 0 where -l . a <= 0     (3)
///     led+field as led, and                e = (3) * g(x'), x' = ShadowOnTable(s, x)      (4)
///
/// s = position_mm, a = axis, mu = anisotropy, phi = flux_rgb, g = field. x must not be s.
[[nodiscard]] Incident IncidentAt(const Light& light, const Eigen::Vector3d& x_mm);

}  // namespace sateen
