#include "rig/rig.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <set>

#include "core/json.h"
#include "core/linear_algebra.h"
#include "rig/calibration_json.h"
#include "rig/light_json.h"
#include "rig/plausible.h"

namespace sateen {
namespace {

using Json = nlohmann::json;

// Below this a vector or rotation is exact but for rounding and stays as it is, so that reading
// what was written changes no bit.
constexpr double kRounding = 1e-14;
constexpr int kMostChannel = 65535;

// Returns the rotation nearest to one that a file has rounded.
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& r) {
  if ((r.transpose() * r - Eigen::Matrix3d::Identity()).lpNorm<Eigen::Infinity>() <= kRounding) {
    return r;
  }
  return NearestOrthogonal(r);
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
  const std::optional<std::vector<double>> pose = reader.OptionalNumbers("table_from_camera", 16);
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  camera.size_px = {static_cast<int>(size_px[0]), static_cast<int>(size_px[1])};
  camera.fx = k[0];
  camera.fy = k[1];
  camera.cx = k[2];
  camera.cy = k[3];
  std::copy(distortion.begin(), distortion.end(), camera.distortion.begin());
  camera.has_pose = pose.has_value();
  if (pose) {
    camera.table_from_camera.matrix() =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(pose->data());
  }
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

nlohmann::ordered_json CameraToJson(const Camera& camera) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = camera.table_from_camera.matrix();
  nlohmann::ordered_json json = {{"model", camera.model},
                                 {"size_px", {camera.size_px.width, camera.size_px.height}},
                                 {"k", {camera.fx, camera.fy, camera.cx, camera.cy}},
                                 {"distortion", camera.distortion}};
  if (camera.has_pose) {
    json["table_from_camera"] = std::vector<double>(pose.data(), pose.data() + pose.size());
  }
  return json;
}

nlohmann::ordered_json ResponseToJson(const Response& response) {
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

Status CheckResponse(const Response& response, std::string_view what) {
  const std::string place = fmt::format("{}: response", what);
  Status status = CheckPlausible(place, ".white", {response.white}, kPlausibleWhite);
  if (status && !(response.black >= 0.0 && response.black < response.white)) {
    status = Fail(ErrorCode::kBadData,
                  "{} has black = {:.6g} and white = {:.6g}; need 0 <= black < white", place,
                  response.black, response.white);
  }
  const Eigen::Vector3d& balance = response.white_balance;
  if (status && !(balance.allFinite() && balance.minCoeff() > 0.0)) {
    status = Fail(ErrorCode::kBadData, "{}.white_balance is [{}]; need factors > 0", place,
                  fmt::join(balance, ", "));
  }
  if (status) {
    status = CheckPlausible(place, ".white_balance", {balance.x(), balance.y(), balance.z()},
                            kPlausibleBalance);
  }
  if (status) {
    status = CheckPlausible(place, ".read_noise_dn", {response.read_noise_dn.value_or(0.0)},
                            kPlausibleNoise);
  }
  if (status) {
    status = CheckPlausible(place, ".gain_dn_per_electron",
                            {response.gain_dn_per_electron.value_or(1.0)}, kPlausibleGain);
  }
  return status;
}

std::string WhatLight(std::string_view what, size_t k) {
  return fmt::format("{}: lights[{}]", what, k);
}

// Fails where a light is another's by so much that both are never in one picture.
Status CheckFluxRatio(const Lights& lights, std::string_view what) {
  for (size_t k = 1; k < lights.size(); ++k) {
    const double ratio = lights[k].flux_rgb.maxCoeff() / lights[0].flux_rgb.maxCoeff();
    if (!(ratio <= kMostFluxRatio && ratio >= 1.0 / kMostFluxRatio)) {
      return Fail(ErrorCode::kBadData,
                  "{}: flux_rgb is {:.3g} times that of lights[0]; need {:.0e} to {:.0e} times",
                  WhatLight(what, k), ratio, 1.0 / kMostFluxRatio, kMostFluxRatio);
    }
  }
  return {};
}

Status CheckLights(const Lights& lights, const std::optional<Camera>& camera,
                   std::string_view what) {
  if (lights.empty() && !camera) {
    return Fail(ErrorCode::kBadData, "{}: lights is empty; need at least one light, or a camera",
                what);
  }
  std::set<std::string_view> names;
  for (size_t k = 0; k < lights.size(); ++k) {
    const Light& light = lights[k];
    if (Status status = light.Validate(WhatLight(what, k)); !status) {
      return status;
    }
    if (light.channel < 0 || light.channel > kMostChannel) {
      return Fail(ErrorCode::kBadData, "{}: channel is {}; need 0 to {}", WhatLight(what, k),
                  light.channel, kMostChannel);
    }
    if (!light.name.empty() && !names.insert(light.name).second) {
      return Fail(ErrorCode::kBadData, "{}: the name \"{}\" is taken; give each light its own",
                  WhatLight(what, k), light.name);
    }
    if (light.model != LightModel::kDistant && camera && !camera->has_pose) {
      return Fail(ErrorCode::kBadData,
                  "{}: camera has no table_from_camera, but lights[{}] is \"{}\": no pixel has a "
                  "place on the table; run sateen calibrate pose first, then add near lights",
                  what, k, Name(light.model));
    }
    if (light.model != LightModel::kDistant && !camera) {
      return Fail(
          ErrorCode::kBadData,
          "{}: camera is missing, but lights[{}] is \"{}\": without a camera no pixel has a "
          "place on the table; calibrate the camera, or use distant lights",
          what, k, Name(light.model));
    }
  }
  return CheckFluxRatio(lights, what);
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
  return status.and_then([&] { return CheckLights(lights, camera, what); });
}

Status Rig::RequirePose(std::string_view what) const {
  if (!camera) {
    return Fail(ErrorCode::kBadData,
                "{}: the rig has no camera, so that no pixel has a place on the table; run sateen "
                "calibrate lens, then sateen calibrate pose",
                what);
  }
  if (!camera->has_pose) {
    return Fail(ErrorCode::kBadData,
                "{}: the rig's camera has a lens but no pose yet, so that no pixel has a place on "
                "the table; run sateen calibrate pose",
                what);
  }
  return {};
}

Eigen::Vector3d WhiteBalanceOf(const Rig& rig) {
  return rig.response ? rig.response->white_balance : Eigen::Vector3d::Ones();
}

Lights Rebalanced(Lights lights, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  for (Light& light : lights) {
    light.flux_rgb = light.flux_rgb.cwiseProduct(to).cwiseQuotient(from);
  }
  return lights;
}

Result<Rig> Lifted(Rig rig, double height_mm) {
  const auto lower = [&](double& z_mm, const std::string& what) -> Status {
    if (!(height_mm < z_mm)) {
      return Fail(ErrorCode::kBadData,
                  "the surface is at {:g} mm, but {} is at {:.6g} mm; need it below", height_mm,
                  what, z_mm);
    }
    z_mm -= height_mm;
    return {};
  };
  Status status =
      std::isfinite(height_mm)
          ? Status()
          : Fail(ErrorCode::kBadData, "the surface is at {} mm; need a number", height_mm);
  if (status && rig.camera && rig.camera->has_pose) {
    status = lower(rig.camera->table_from_camera.translation().z(), "the camera");
  }
  for (size_t k = 0; status && k < rig.lights.size(); ++k) {
    Light& light = rig.lights[k];
    if (light.model == LightModel::kDistant) {
      continue;
    }
    const double above_table_mm = light.position_mm.z();
    status = lower(light.position_mm.z(), fmt::format("lights[{}]", k));
    const double nearer = light.position_mm.z() / above_table_mm;
    const Eigen::Vector2d foot_mm = light.position_mm.head<2>();
    light.field.origin_mm = foot_mm + (light.field.origin_mm - foot_mm) * nearer;  // (1)
    light.field.spacing_mm *= nearer;
  }
  return status.map([&] { return std::move(rig); });
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
    rig.calibration = ReadCalibrationRecords(file->at("calibration"));
  }
  if (Status status = reader.Finish().and_then([&] { return rig.Validate(what); }); !status) {
    return tl::unexpected(status.error());
  }
  return rig;
}

std::string RigToJson(const Rig& rig) {
  std::vector<std::string> members = {R"(  "schema": "sateen.rig/1")"};
  if (rig.camera) {
    members.push_back("  \"camera\": " + JsonText(CameraToJson(*rig.camera)));
  }
  if (rig.response) {
    members.push_back("  \"response\": " + JsonText(ResponseToJson(*rig.response)));
  }
  std::vector<std::string> lights;
  for (const Light& light : rig.lights) {
    lights.push_back("    " + JsonText(ToJson(light)));
  }
  members.push_back(lights.empty()
                        ? R"(  "lights": [])"
                        : fmt::format("  \"lights\": [\n{}\n  ]", fmt::join(lights, ",\n")));
  if (rig.calibration != CalibrationRecords()) {
    members.push_back("  \"calibration\": " + JsonText(ToJson(rig.calibration)));
  }
  return fmt::format("{{\n{}\n}}\n", fmt::join(members, ",\n"));
}

}  // namespace sateen
