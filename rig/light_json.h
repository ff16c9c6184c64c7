#pragma once

// A light in rig.json; for .cc files of this module only.

#include <string>

#include "core/json.h"
#include "rig/light.h"

namespace sateen {

[[nodiscard]] Eigen::Vector3d Vector3(const std::vector<double>& numbers);

// Fails with kBadData where a key is missing, unknown, out of range or not of the light's model.
// `what` names the light in the messages. Direction and axis come back exactly normalised.
[[nodiscard]] Result<Light> ReadLight(JsonReader reader, const std::string& what);

[[nodiscard]] nlohmann::json ToJson(const Eigen::Vector3d& v);
[[nodiscard]] nlohmann::ordered_json ToJson(const Light& light);

}  // namespace sateen
