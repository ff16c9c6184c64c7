#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/error.h"
#include "rig/camera.h"
#include "rig/light.h"

namespace sateen {

// What the sensor does to light, as far as it is known.
struct Response {
  double black = 0.0;                                       // [DN]
  double white = 0.0;                                       // [DN]
  Eigen::Vector3d white_balance = Eigen::Vector3d::Ones();  // factors for red, green, blue
  std::optional<double> read_noise_dn;
  std::optional<double> gain_dn_per_electron;
};

// The measured scanner: one camera, K lights, one table. A plain value; docs/formats.md describes
// the file.
struct Rig {
  std::optional<Camera> camera;  // absent only when every light is distant
  std::optional<Response> response;
  Lights lights;
  std::string calibration_json;  // figures and input hashes, kept as they were read

  // kBadData names the first thing that is out of range or missing. `what` is the file.
  [[nodiscard]] Status Validate(std::string_view what) const;
};

// Errors   kIo: the file is absent or unreadable
//          kBadData: not schema sateen.rig/1; a key that is missing, unknown, out of range or not
//          of the light's model; a light that is not above the table
// Directions, axes and the camera's rotation, which files round, come back exactly normalised.
[[nodiscard]] Result<Rig> ReadRig(const std::filesystem::path& path);

// The text of a valid rig's file, one line a light. Reading it gives the same rig to the last bit.
[[nodiscard]] std::string RigToJson(const Rig& rig);

}  // namespace sateen
