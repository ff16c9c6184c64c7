#include "pipelines/simulate/scene_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/json.h"
#include "pipelines/simulate/scene_sample.h"

namespace sateen {
namespace {

Status ReadIllumination(JsonReader reader, Illumination& illumination) {
  if (const auto shadows = reader.OptionalString("shadows")) {
    constexpr std::array<std::string_view, 3> kNames = {"none", "attached", "cast"};
    const auto* const found = std::ranges::find(kNames, *shadows);
    reader.Require(found != kNames.end(), "shadows",
                   fmt::format("'{}'; need none, attached or cast", *shadows));
    illumination.shadows = static_cast<Shadows>(found - kNames.begin());
  }
  illumination.shadow_samples =
      reader.OptionalInteger("shadow_samples").value_or(illumination.shadow_samples);
  illumination.bounce_rays =
      reader.OptionalInteger("bounce_rays").value_or(illumination.bounce_rays);
  if (const auto ambient = reader.OptionalNumbers("ambient_rgb", 3)) {
    illumination.ambient_rgb = Eigen::Vector3d(ambient->data());
  }
  illumination.flicker = reader.OptionalNumber("flicker").value_or(0.0);
  if (const auto dead = reader.OptionalString("dead")) {
    illumination.dead = {*dead};
  }
  return reader.Finish();
}

Status ReadLens(JsonReader reader, Lens& lens) {
  if (const auto vignetting = reader.OptionalNumbers("vignetting", 3)) {
    lens.vignetting = {(*vignetting)[0], (*vignetting)[1], (*vignetting)[2]};
  }
  lens.psf_sigma_px = reader.OptionalNumber("psf_sigma_px").value_or(0.0);
  lens.samples = reader.OptionalInteger("samples").value_or(lens.samples);
  if (std::optional<JsonReader> bump = reader.OptionalObject("bump")) {
    lens.bump_from = bump->String("from");
    const std::vector<double> shift = bump->Numbers("shift_px", 2);
    if (Status status = bump->Finish(); !status) {
      return status;
    }
    lens.bump_px = {shift[0], shift[1]};
  }
  return reader.Finish();
}

Status ReadSensor(JsonReader reader, Sensor& sensor) {
  if (const auto preset = reader.OptionalString("preset")) {
    const std::optional<Sensor> named = SensorNamed(*preset);
    reader.Require(named.has_value(), "preset", fmt::format("'{}'; need nikon-d5100", *preset));
    sensor = named.value_or(Sensor());
  }
  if (const auto bits = reader.OptionalInteger("bits")) {
    if (*bits != sensor.bits) {  // a preset's own white stays with its own bits
      sensor.white_dn = std::exp2(*bits) - 1.0;
    }
    sensor.bits = *bits;
  }
  sensor.black_dn = reader.OptionalNumber("black").value_or(sensor.black_dn);
  sensor.white_dn = reader.OptionalNumber("white").value_or(sensor.white_dn);
  sensor.saturation_dn = reader.OptionalNumber("saturation");
  sensor.full_scale = reader.OptionalNumber("full_scale").value_or(sensor.full_scale);
  if (const auto sensitivity = reader.OptionalNumbers("sensitivity_rgb", 3)) {
    sensor.sensitivity_rgb = {(*sensitivity)[0], (*sensitivity)[1], (*sensitivity)[2]};
  }
  sensor.knee = reader.OptionalNumber("knee").value_or(sensor.knee);
  sensor.compression = reader.OptionalNumber("compression").value_or(sensor.compression);
  if (const auto bayer = reader.OptionalString("bayer")) {
    const auto cfa = BayerNamed(*bayer);
    reader.Require(cfa.has_value(), "bayer",
                   fmt::format("'{}'; need RGGB, GRBG, GBRG or BGGR", *bayer));
    sensor.cfa = cfa.value_or(sensor.cfa);
  }
  if (const auto full_well = reader.OptionalNumber("full_well_electrons")) {
    sensor.full_well_electrons = full_well;
  }
  sensor.read_noise_electrons =
      reader.OptionalNumber("read_noise_electrons").value_or(sensor.read_noise_electrons);
  return reader.Finish();
}

Status ReadExposure(JsonReader reader, ExposureRecord& exposure) {
  exposure.exposure_s = reader.Number("exposure_s");
  exposure.f_number = reader.Number("f_number");
  exposure.iso = reader.Number("iso");
  exposure.series_s = reader.OptionalNumberList("series_s").value_or(std::vector<double>());
  exposure.series_light = reader.OptionalString("series_light").value_or("");
  exposure.repeats = reader.OptionalInteger("repeats").value_or(1);
  // What a DNG file can hold.
  const auto require = [&](std::string_view key, bool holds, double value, std::string_view range) {
    reader.Require(holds, key, fmt::format("{:g}; need {}", value, range));
  };
  require("exposure_s", exposure.exposure_s >= 1e-6 && exposure.exposure_s <= 1e5,
          exposure.exposure_s, "1e-6 to 1e5");
  for (const double time_s : exposure.series_s) {
    require("series_s", time_s >= 1e-6 && time_s <= 1e5, time_s, "1e-6 to 1e5 each");
  }
  require("repeats", exposure.repeats >= 1 && exposure.repeats <= 100, exposure.repeats,
          "1 to 100");
  require("f_number", exposure.f_number >= 0.01 && exposure.f_number <= 1e4, exposure.f_number,
          "0.01 to 1e4");
  require(
      "iso",
      exposure.iso >= 1.0 && exposure.iso <= 65535.0 && exposure.iso == std::floor(exposure.iso),
      exposure.iso, "a whole number from 1 to 65535");
  return reader.Finish();
}

// The error of a value that a library refused, as one of this file's key.
Status InFile(const Status& status, const std::filesystem::path& path, std::string_view key = "") {
  if (status || status.error().code != ErrorCode::kInvalidArgument) {
    return status;
  }
  return Fail(ErrorCode::kBadData, "{}: {}{}", path.string(), key, status.error().message);
}

}  // namespace

Result<SceneFile> ReadSceneFile(const std::filesystem::path& path) {
  const Result<nlohmann::json> json = ReadJsonFile(path, "sateen.scene", 1);
  if (!json) {
    return tl::unexpected(json.error());
  }
  SceneFile file;
  JsonReader top(*json, path.string());
  file.title = top.OptionalString("title").value_or("");
  const std::string rig_file = top.String("rig");
  file.inputs = {path, path.parent_path() / rig_file};
  const std::string kind = top.OptionalString("kind").value_or("fabric");
  constexpr std::array kKinds = {SessionKind::kFabric, SessionKind::kSheet, SessionKind::kChart,
                                 SessionKind::kBoard};
  const auto* const known_kind =
      std::ranges::find_if(kKinds, [&](SessionKind known) { return Name(known) == kind; });
  top.Require(known_kind != kKinds.end(), "kind",
              fmt::format("'{}'; need fabric, sheet, chart or board", kind));
  file.kind = known_kind != kKinds.end() ? *known_kind : SessionKind::kFabric;
  if (const auto seed = top.OptionalInteger("seed")) {
    top.Require(*seed >= 0, "seed", fmt::format("{}; need 0 or more", *seed));
    file.scene.seed = static_cast<uint64_t>(std::max(*seed, 0));
  }
  JsonReader surface = top.Object("surface");
  JsonReader materials = top.Object("materials");
  std::optional<JsonReader> illumination = top.OptionalObject("illumination");
  std::optional<JsonReader> lens = top.OptionalObject("lens");
  std::optional<JsonReader> sensor = top.OptionalObject("sensor");
  std::optional<JsonReader> exposure = top.OptionalObject("exposure");
  Status status = top.Finish();
  if (status) {
    Result<SurfacePtr> made = ReadSurface(surface, path.parent_path());
    if (made) {
      file.scene.surface = std::move(*made);
    } else {
      status = InFile(tl::unexpected(made.error()), path, "surface.");
    }
  }
  if (status) {
    status = InFile(ReadMaterials(materials, file.scene), path);
  }
  if (status && illumination) {
    status = ReadIllumination(*illumination, file.scene.illumination);
  }
  if (status && lens) {
    status = ReadLens(*lens, file.scene.lens);
  }
  if (status && sensor) {
    status = ReadSensor(*sensor, file.sensor);
  }
  if (status && exposure) {
    status = ReadExposure(*exposure, file.exposure);
  }
  if (status) {
    status = InFile(file.sensor.Validate(), path, "sensor.");
  }
  if (!status) {
    return tl::unexpected(status.error());
  }
  Result<Rig> rig = ReadRig(path.parent_path() / rig_file);
  if (!rig) {
    return Fail(rig.error().code, "{}: rig: {}", path.string(), rig.error().message);
  }
  file.scene.rig = std::move(*rig);
  if (status = InFile(file.scene.Validate(), path); !status) {
    return tl::unexpected(status.error());
  }
  if (file.kind != SessionKind::kChart &&
      (!file.exposure.series_s.empty() || file.exposure.repeats > 1)) {
    return Fail(ErrorCode::kBadData,
                "{}: exposure.{} is for kind chart alone: other sessions have one frame of a light",
                path.string(), file.exposure.series_s.empty() ? "repeats" : "series_s");
  }
  const Lights& lights = file.scene.rig.lights;
  if (!file.exposure.series_light.empty() &&
      std::ranges::find(lights, file.exposure.series_light, &Light::name) == lights.end()) {
    return Fail(ErrorCode::kBadData, "{}: exposure.series_light is '{}', which the rig has not",
                path.string(), file.exposure.series_light);
  }
  if (file.kind == SessionKind::kSheet && !file.scene.surface->IsPlane()) {
    return Fail(ErrorCode::kBadData,
                "{}: surface.shape is no plane, but kind is sheet; need plane or tilted-plane",
                path.string());
  }
  if (const auto* print = std::get_if<PrintAlbedo>(&file.scene.materials[0].albedo)) {
    file.target_is_printed = true;
    file.table_from_target = print->table_from_print;
  } else if (file.kind == SessionKind::kSheet) {
    file.table_from_target = TableFromPlane(*file.scene.surface);
  }
  return file;
}

}  // namespace sateen
