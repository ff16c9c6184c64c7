#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/error.h"
#include "rig/calibration_record.h"
#include "rig/camera.h"
#include "rig/light.h"

namespace sateen {

// The sensor's response to light, as far as it is known.
struct Response {
  double black = 0.0;                                       // [DN]
  double white = 0.0;                                       // [DN]
  Eigen::Vector3d white_balance = Eigen::Vector3d::Ones();  // factors for red, green, blue
  std::optional<double> read_noise_dn;
  std::optional<double> gain_dn_per_electron;

  bool operator==(const Response&) const = default;
};

// The measured scanner: one camera, K lights, one table. A plain value; docs/formats.md describes
// the file.
struct Rig {
  std::optional<Camera> camera;  // absent, or without a pose, only when every light is distant
  std::optional<Response> response;
  Lights lights;  // empty only where there is a camera: while it is calibrated
  CalibrationRecords calibration;

  bool operator==(const Rig&) const = default;

  // Fails with kBadData and the first thing that is out of range or missing. `what`: the file.
  [[nodiscard]] Status Validate(std::string_view what) const;
  // Fails with kBadData unless pixels have a place on the table; names the missing calibration.
  [[nodiscard]] Status RequirePose(std::string_view what) const;
};

// Returns a rig's white balance; 1 where it has no response.
[[nodiscard]] Eigen::Vector3d WhiteBalanceOf(const Rig& rig);

// Returns the lights as a rig of another white balance has them. Fluxes are in balanced units, as
// the frames are (scanner/sessions/frames/sensor_reading.h), so that albedo stays the same.
[[nodiscard]] Lights Rebalanced(Lights lights, const Eigen::Vector3d& from,
                                const Eigen::Vector3d& to);

/// Returns the rig seen from a table plane that lies `height_mm` higher: camera and lights by that
/// much lower, and each field of gains as the light's rays throw its knots onto the new plane:
///
///     x' = s + (x - s) (s_z - height) / s_z                                                   (1)
///
/// This is exact: light and irradiance at a point of space stay the same. Code that takes the
/// surface to lie in z = 0 then has it at z = height.
///
/// Errors   kBadData: not a number; the camera or a near light is not above the new plane
[[nodiscard]] Result<Rig> Lifted(Rig rig, double height_mm);

// Reads a rig. Directions, axes and the camera's rotation, which files round, come back exactly
// normalised.
// Errors   kIo: the file is absent or unreadable
//          kBadData: not schema sateen.rig/1; a key that is missing, unknown, out of range or not
//          of the light's model; a light that is not above the table
[[nodiscard]] Result<Rig> ReadRig(const std::filesystem::path& path);

// Returns the text of a valid rig's file, one line per light. Reading it gives the same rig to the
// last bit.
[[nodiscard]] std::string RigToJson(const Rig& rig);

}  // namespace sateen
