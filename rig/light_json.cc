#include "rig/light_json.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sateen {
namespace {

// Below this a vector is a unit vector but for rounding and stays as it is, so that reading what
// was written changes no bit.
constexpr double kUnitRounding = 1e-14;

Eigen::Vector3d Unit(const Eigen::Vector3d& v) {
  return std::abs(v.norm() - 1.0) > kUnitRounding ? v.normalized() : v;
}

LightModel ReadModel(JsonReader& reader) {
  const std::string name = reader.String("model");
  for (const LightModel model :
       {LightModel::kDistant, LightModel::kNear, LightModel::kLed, LightModel::kLedField}) {
    if (name == Name(model)) {
      return model;
    }
  }
  reader.Require(
      false, "model",
      fmt::format("is \"{}\"; need \"distant\", \"near\", \"led\" or \"led+field\"", name));
  return LightModel::kDistant;
}

// Frames are named after their lights.
bool IsFileName(const std::string& name) {
  return !name.empty() && name != "." && name != ".." &&
         std::none_of(name.begin(), name.end(),
                      [](unsigned char c) { return c == '/' || c < 0x20 || c == 0x7f; });
}

Result<GainField> ReadField(JsonReader reader) {
  GainField field;
  const std::vector<double> origin_mm = reader.Numbers("origin_mm", 2);
  field.origin_mm = {origin_mm[0], origin_mm[1]};
  field.spacing_mm = reader.Number("spacing_mm");
  field.columns = reader.Integer("columns");
  field.rows = reader.Integer("rows");
  for (const auto& [key, count] :
       {std::pair("columns", field.columns), std::pair("rows", field.rows)}) {
    reader.Require(count >= 1 && count <= kMostFieldKnots, key,
                   fmt::format("is {}; need 4 to {}", count, kMostFieldKnots));
  }
  // Counts that are refused must not ask for that many numbers.
  const int columns = std::clamp(field.columns, 0, kMostFieldKnots);
  const int rows = std::clamp(field.rows, 0, kMostFieldKnots);
  field.gain = reader.Numbers("gain", static_cast<size_t>(columns) * static_cast<size_t>(rows));
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  return field;
}

}  // namespace

Eigen::Vector3d Vector3(const std::vector<double>& numbers) {
  return Eigen::Map<const Eigen::Vector3d>(numbers.data());
}

Result<Light> ReadLight(JsonReader reader, const std::string& what) {
  Light light;
  light.name = reader.String("name");
  reader.Require(IsFileName(light.name), "name",
                 fmt::format("is \"{}\"; need a name that a frame's file can have, without / and "
                             "control characters",
                             light.name));
  light.channel = reader.Integer("channel");
  light.model = ReadModel(reader);
  if (light.model == LightModel::kDistant) {
    light.direction = Vector3(reader.Numbers("direction", 3));
    light.direction_sd_deg = reader.OptionalNumber("direction_sd_deg");
    reader.Require(light.direction.z() > 0.0, "direction",
                   fmt::format("has z = {}; need z > 0, above the table", light.direction.z()));
  } else {
    light.position_mm = Vector3(reader.Numbers("position_mm", 3));
    if (const auto sd = reader.OptionalNumbers("position_sd_mm", 3)) {
      light.position_sd_mm = Vector3(*sd);
    }
  }
  if (IsLed(light.model)) {
    light.axis = Vector3(reader.Numbers("axis", 3));
    light.anisotropy = reader.Number("anisotropy");
  }
  if (light.model == LightModel::kLedField) {
    Result<GainField> field = ReadField(reader.Object("field"));
    if (!field) {
      return tl::unexpected(field.error());
    }
    light.field = *std::move(field);
  }
  light.flux_rgb = Vector3(reader.Numbers("flux_rgb", 3));
  light.irradiance_sd = reader.OptionalNumber("irradiance_sd");
  if (Status status = reader.Finish().and_then([&] { return light.Validate(what); }); !status) {
    return tl::unexpected(status.error());
  }
  light.direction = Unit(light.direction);
  light.axis = Unit(light.axis);
  return light;
}

nlohmann::json ToJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

nlohmann::ordered_json ToJson(const Light& light) {
  nlohmann::ordered_json json = {
      {"name", light.name}, {"channel", light.channel}, {"model", Name(light.model)}};
  if (light.model == LightModel::kDistant) {
    json["direction"] = ToJson(light.direction);
  } else {
    json["position_mm"] = ToJson(light.position_mm);
  }
  if (light.direction_sd_deg && light.model == LightModel::kDistant) {
    json["direction_sd_deg"] = *light.direction_sd_deg;
  }
  if (light.position_sd_mm && light.model != LightModel::kDistant) {
    json["position_sd_mm"] = ToJson(*light.position_sd_mm);
  }
  if (IsLed(light.model)) {
    json["axis"] = ToJson(light.axis);
    json["anisotropy"] = light.anisotropy;
  }
  if (light.model == LightModel::kLedField) {
    json["field"] = {{"origin_mm", {light.field.origin_mm.x(), light.field.origin_mm.y()}},
                     {"spacing_mm", light.field.spacing_mm},
                     {"columns", light.field.columns},
                     {"rows", light.field.rows},
                     {"gain", light.field.gain}};
  }
  json["flux_rgb"] = ToJson(light.flux_rgb);
  if (light.irradiance_sd) {
    json["irradiance_sd"] = *light.irradiance_sd;
  }
  return json;
}

}  // namespace sateen
