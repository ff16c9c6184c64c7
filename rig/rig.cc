#include "rig/rig.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <set>

#include "core/json.h"

namespace sateen {
namespace {

using Json = nlohmann::json;

// Below this a vector or rotation is exact but for rounding and stays as it is, so that reading
// what was written changes no bit.
constexpr double kRounding = 1e-14;

Eigen::Vector3d Vector3(const std::vector<double>& numbers) {
  return Eigen::Map<const Eigen::Vector3d>(numbers.data());
}

Eigen::Vector3d Unit(const Eigen::Vector3d& v) {
  return std::abs(v.norm() - 1.0) > kRounding ? v.normalized() : v;
}

// The rotation nearest to one that a file has rounded.
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& r) {
  if ((r.transpose() * r - Eigen::Matrix3d::Identity()).lpNorm<Eigen::Infinity>() <= kRounding) {
    return r;
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

Result<Camera> ReadCamera(JsonReader reader, const std::string& what) {
  Camera camera;
  camera.model = reader.String("model");
  const std::vector<double> size_px = reader.Numbers("size_px", 2);
  for (const double side : size_px) {
    reader.Require(side == std::floor(side) && std::abs(side) < 1e6, "size_px",
                   fmt::format("is [{}]; need two whole numbers", fmt::join(size_px, ", ")));
  }
  const std::vector<double> k = reader.Numbers("k", 4);
  const std::vector<double> distortion = reader.Numbers("distortion", 5);
  const std::vector<double> pose = reader.Numbers("table_from_camera", 16);
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  camera.size_px = {static_cast<int>(size_px[0]), static_cast<int>(size_px[1])};
  camera.fx = k[0];
  camera.fy = k[1];
  camera.cx = k[2];
  camera.cy = k[3];
  std::copy(distortion.begin(), distortion.end(), camera.distortion.begin());
  camera.table_from_camera.matrix() =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(pose.data());
  if (Status status = camera.Validate(what); !status) {
    return tl::unexpected(status.error());
  }
  camera.table_from_camera.linear() = NearestRotation(camera.table_from_camera.linear());
  return camera;
}

Result<Response> ReadResponse(JsonReader reader) {
  Response response;
  response.black = reader.Number("black");
  response.white = reader.Number("white");
  response.white_balance = Vector3(reader.Numbers("white_balance", 3));
  response.read_noise_dn = reader.OptionalNumber("read_noise_dn");
  response.gain_dn_per_electron = reader.OptionalNumber("gain_dn_per_electron");
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  return response;
}

LightModel ReadModel(JsonReader& reader) {
  const std::string name = reader.String("model");
  for (const LightModel model : {LightModel::kDistant, LightModel::kNear, LightModel::kLed}) {
    if (name == Name(model)) {
      return model;
    }
  }
  reader.Require(false, "model",
                 fmt::format("is \"{}\"; need \"distant\", \"near\" or \"led\"", name));
  return LightModel::kDistant;
}

// Frames are named after their lights.
bool IsFileName(const std::string& name) {
  return !name.empty() && name != "." && name != ".." &&
         std::none_of(name.begin(), name.end(),
                      [](unsigned char c) { return c == '/' || c < 0x20 || c == 0x7f; });
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
  reader.Require(!reader.Has("field"), "field",
                 "is of the rung \"led + field\", which this version cannot use; calibrate the "
                 "lights with this version, or use the version that wrote the file");
  if (light.model == LightModel::kDistant) {
    light.direction = Vector3(reader.Numbers("direction", 3));
    reader.Require(light.direction.z() > 0.0, "direction",
                   fmt::format("has z = {}; need z > 0, above the table", light.direction.z()));
  } else {
    light.position_mm = Vector3(reader.Numbers("position_mm", 3));
  }
  if (light.model == LightModel::kLed) {
    light.axis = Vector3(reader.Numbers("axis", 3));
    light.anisotropy = reader.Number("anisotropy");
  }
  light.flux_rgb = Vector3(reader.Numbers("flux_rgb", 3));
  if (Status status = reader.Finish().and_then([&] { return light.Validate(what); }); !status) {
    return tl::unexpected(status.error());
  }
  light.direction = Unit(light.direction);
  light.axis = Unit(light.axis);
  return light;
}

Json ToJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

nlohmann::ordered_json ToJson(const Camera& camera) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = camera.table_from_camera.matrix();
  return {{"model", camera.model},
          {"size_px", {camera.size_px.width, camera.size_px.height}},
          {"k", {camera.fx, camera.fy, camera.cx, camera.cy}},
          {"distortion", camera.distortion},
          {"table_from_camera", std::vector<double>(pose.data(), pose.data() + pose.size())}};
}

nlohmann::ordered_json ToJson(const Response& response) {
  nlohmann::ordered_json json = {{"black", response.black},
                                 {"white", response.white},
                                 {"white_balance", ToJson(response.white_balance)}};
  if (response.read_noise_dn) {
    json["read_noise_dn"] = *response.read_noise_dn;
  }
  if (response.gain_dn_per_electron) {
    json["gain_dn_per_electron"] = *response.gain_dn_per_electron;
  }
  return json;
}

nlohmann::ordered_json ToJson(const Light& light) {
  nlohmann::ordered_json json = {
      {"name", light.name}, {"channel", light.channel}, {"model", Name(light.model)}};
  if (light.model == LightModel::kDistant) {
    json["direction"] = ToJson(light.direction);
  } else {
    json["position_mm"] = ToJson(light.position_mm);
  }
  if (light.model == LightModel::kLed) {
    json["axis"] = ToJson(light.axis);
    json["anisotropy"] = light.anisotropy;
  }
  json["flux_rgb"] = ToJson(light.flux_rgb);
  return json;
}

// On one line; a name that is not UTF-8 must not end the run.
std::string Line(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

Status CheckResponse(const Response& response, std::string_view what) {
  if (!(std::isfinite(response.white) && response.black >= 0.0 &&
        response.black < response.white)) {
    return Fail(ErrorCode::kBadData,
                "{}: response has black = {:.6g} and white = {:.6g}; need 0 <= black < white", what,
                response.black, response.white);
  }
  if (!(response.white_balance.allFinite() && response.white_balance.minCoeff() > 0.0)) {
    return Fail(ErrorCode::kBadData, "{}: response.white_balance is [{}]; need factors > 0", what,
                fmt::join(response.white_balance, ", "));
  }
  const double read_noise_dn = response.read_noise_dn.value_or(0.0);
  if (!(read_noise_dn >= 0.0 && std::isfinite(read_noise_dn))) {
    return Fail(ErrorCode::kBadData, "{}: response.read_noise_dn is {:.6g}; need 0 or more", what,
                read_noise_dn);
  }
  const double gain = response.gain_dn_per_electron.value_or(1.0);
  if (!(gain > 0.0 && std::isfinite(gain))) {
    return Fail(ErrorCode::kBadData,
                "{}: response.gain_dn_per_electron is {:.6g}; need a number > 0", what, gain);
  }
  return {};
}

std::string WhatLight(std::string_view what, size_t k) {
  return fmt::format("{}: lights[{}]", what, k);
}

Status CheckLights(const Lights& lights, bool has_camera, std::string_view what) {
  if (lights.empty()) {
    return Fail(ErrorCode::kBadData, "{}: lights is empty; need at least one light", what);
  }
  std::set<std::string_view> names;
  for (size_t k = 0; k < lights.size(); ++k) {
    const Light& light = lights[k];
    if (Status status = light.Validate(WhatLight(what, k)); !status) {
      return status;
    }
    if (light.channel < 0) {
      return Fail(ErrorCode::kBadData, "{}: channel is {}; need 0 or more", WhatLight(what, k),
                  light.channel);
    }
    if (!light.name.empty() && !names.insert(light.name).second) {
      return Fail(ErrorCode::kBadData, "{}: the name \"{}\" is taken; give each light its own",
                  WhatLight(what, k), light.name);
    }
    if (light.model != LightModel::kDistant && !has_camera) {
      return Fail(
          ErrorCode::kBadData,
          "{}: camera is missing, but lights[{}] is \"{}\": without a camera no pixel has a "
          "place on the table; calibrate the camera, or use distant lights",
          what, k, Name(light.model));
    }
  }
  return {};
}

}  // namespace

Status Rig::Validate(std::string_view what) const {
  Status status;
  if (camera) {
    status = camera->Validate(fmt::format("{}: camera", what));
  }
  if (status && response) {
    status = CheckResponse(*response, what);
  }
  if (status && !calibration_json.empty() &&
      !Json::parse(calibration_json, nullptr, /*allow_exceptions=*/false).is_object()) {
    return Fail(ErrorCode::kBadData, "{}: calibration is not a JSON object; need one", what);
  }
  return status.and_then([&] { return CheckLights(lights, camera.has_value(), what); });
}

Result<Rig> ReadRig(const std::filesystem::path& path) {
  const Result<Json> file = ReadJsonFile(path, "sateen.rig", 1);
  if (!file) {
    return tl::unexpected(file.error());
  }
  const std::string what = path.string();
  JsonReader reader(*file, what);
  Rig rig;
  if (std::optional<JsonReader> camera_reader = reader.OptionalObject("camera")) {
    Result<Camera> camera = ReadCamera(*std::move(camera_reader), what + ": camera");
    if (!camera) {
      return tl::unexpected(camera.error());
    }
    rig.camera = *std::move(camera);
  }
  if (std::optional<JsonReader> response_reader = reader.OptionalObject("response")) {
    const Result<Response> response = ReadResponse(*std::move(response_reader));
    if (!response) {
      return tl::unexpected(response.error());
    }
    rig.response = *response;
  }
  for (JsonReader& light_reader : reader.Objects("lights")) {
    Result<Light> light = ReadLight(std::move(light_reader), WhatLight(what, rig.lights.size()));
    if (!light) {
      return tl::unexpected(light.error());
    }
    rig.lights.push_back(*std::move(light));
  }
  if (reader.OptionalObject("calibration")) {
    rig.calibration_json = file->at("calibration").dump();
  }
  if (Status status = reader.Finish().and_then([&] { return rig.Validate(what); }); !status) {
    return tl::unexpected(status.error());
  }
  return rig;
}

std::string RigToJson(const Rig& rig) {
  std::vector<std::string> members = {R"(  "schema": "sateen.rig/1")"};
  if (rig.camera) {
    members.push_back("  \"camera\": " + Line(ToJson(*rig.camera)));
  }
  if (rig.response) {
    members.push_back("  \"response\": " + Line(ToJson(*rig.response)));
  }
  std::vector<std::string> lights;
  for (const Light& light : rig.lights) {
    lights.push_back("    " + Line(ToJson(light)));
  }
  members.push_back(fmt::format("  \"lights\": [\n{}\n  ]", fmt::join(lights, ",\n")));
  if (!rig.calibration_json.empty()) {
    members.push_back("  \"calibration\": " + rig.calibration_json);
  }
  return fmt::format("{{\n{}\n}}\n", fmt::join(members, ",\n"));
}

}  // namespace sateen
