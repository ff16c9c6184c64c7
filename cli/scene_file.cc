#include "cli/scene_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/angle.h"
#include "core/json.h"
#include "imaging/image_io.h"
#include "reflectance/specular.h"
#include "simulation/weave.h"

namespace sateen::cli {
namespace {

constexpr double kGroundAlbedo = 0.03;  // what lies below the yarns, unless the file says

// A number of degrees in [low, high), as radians.
double Angle(JsonReader& reader, std::string_view key, double low, double high) {
  const double deg = reader.Number(key);
  reader.Require(deg >= low && deg < high, key,
                 fmt::format("{:g}; need {:g} to below {:g} degrees", deg, low, high));
  return deg * kRadPerDeg;
}

Result<SurfacePtr> ReadHeightMap(JsonReader& reader, const std::filesystem::path& folder) {
  const std::string file = reader.String("file");
  const double pitch_mm = reader.Number("pitch_mm");
  const double scale_mm = reader.OptionalNumber("scale_mm").value_or(1.0);
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  Result<Photo> photo = ReadPhoto(folder / file, Encoding::kLinear);
  if (!photo) {
    return tl::unexpected(photo.error());
  }
  Image<float>& height = photo->rgb[0];
  for (float& z : height.pixels) {
    z *= static_cast<float>(scale_mm);
  }
  return MakeHeightMap(std::move(height), pitch_mm);
}

// Finishes `reader` where it succeeds.
Result<SurfacePtr> ReadSurface(JsonReader& reader, const std::filesystem::path& folder) {
  const std::string shape = reader.String("shape");
  const auto finished = [&](auto make) -> Result<SurfacePtr> {
    if (Status status = reader.Finish(); !status) {
      return tl::unexpected(status.error());
    }
    return make();
  };
  if (shape == "plane") {
    return finished([] { return MakePlane(0.0, 0.0); });
  }
  if (shape == "tilted-plane") {
    const double slope_rad = Angle(reader, "slope_deg", 0.0, 90.0);
    const double azimuth_rad = Angle(reader, "azimuth_deg", -360.0, 360.0);
    return finished([&] { return MakePlane(slope_rad, azimuth_rad); });
  }
  if (shape == "sphere") {
    const double radius_mm = reader.Number("radius_mm");
    const double edge_rad = Angle(reader, "edge_deg", 0.0, 90.0);
    return finished([&] { return MakeSphereCap(radius_mm, edge_rad); });
  }
  if (shape == "groove") {
    const double depth_mm = reader.Number("depth_mm");
    const double opening_rad = Angle(reader, "opening_deg", 0.0, 180.0);
    return finished([&] { return MakeGroove(depth_mm, opening_rad); });
  }
  if (shape == "steps") {
    const int count = reader.Integer("count");
    const double tread_mm = reader.Number("tread_mm");
    const double rise_mm = reader.Number("rise_mm");
    const double riser_mm = reader.Number("riser_mm");
    return finished([&] { return MakeSteps(count, tread_mm, rise_mm, riser_mm); });
  }
  if (shape == "waves") {
    const double period_mm = reader.Number("period_mm");
    const double max_slope_rad = Angle(reader, "max_slope_deg", 0.0, 90.0);
    return finished([&] { return MakeWaves(period_mm, max_slope_rad); });
  }
  if (shape == "height-map") {
    return ReadHeightMap(reader, folder);
  }
  const std::optional<WeavePattern> pattern = WeavePatternNamed(shape);
  reader.Require(pattern.has_value(), "shape",
                 fmt::format("'{}'; need plane, tilted-plane, sphere, groove, steps, waves, "
                             "height-map, plain, twill, satin, rib or knit",
                             shape));
  if (!pattern) {
    return tl::unexpected(reader.Finish().error());
  }
  const WeaveSpec spec{.pattern = *pattern,
                       .pitch_mm = reader.Number("pitch_mm"),
                       .fill = reader.Number("fill"),
                       .edge_rad = Angle(reader, "edge_deg", 0.0, 90.0),
                       .amplitude_mm = reader.Number("amplitude_mm")};
  return finished([&] { return MakeWeave(spec); });
}

Eigen::Vector3d Rgb(const std::vector<double>& numbers) {
  return numbers.size() == 3 ? Eigen::Vector3d(numbers[0], numbers[1], numbers[2])
                             : Eigen::Vector3d::Zero();
}

Result<Albedo> ReadTexture(JsonReader reader) {
  const std::string kind = reader.String("kind");
  Albedo albedo;
  if (kind == "waves") {
    albedo = WavyAlbedo{.min = reader.Number("min"),
                        .max = reader.Number("max"),
                        .period_mm = reader.Number("period_mm")};
  } else if (kind == "chessboard") {
    albedo = ChessboardAlbedo{.columns = reader.Integer("columns"),
                              .rows = reader.Integer("rows"),
                              .square_mm = reader.Number("square_mm"),
                              .dark = reader.Number("dark"),
                              .light = reader.Number("light")};
  } else if (kind == "patches") {
    const int count = reader.Integer("count");
    albedo =
        PatchesAlbedo{.values = reader.Numbers("values", static_cast<size_t>(std::max(count, 0))),
                      .patch_mm = reader.Number("patch_mm")};
  } else {
    reader.Require(false, "kind", fmt::format("'{}'; need waves, chessboard or patches", kind));
  }
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  return albedo;
}

// A BRDF after it was checked, or the error with the key.
template <typename Model>
Result<std::shared_ptr<const Brdf>> Checked(JsonReader& reader, const Model& model) {
  if (Status status = reader.Finish().and_then([&] { return model.Validate(); }); !status) {
    return tl::unexpected(status.error());
  }
  return std::make_shared<const Model>(model);
}

Result<std::shared_ptr<const Brdf>> ReadSpecular(JsonReader reader) {
  const std::string model = reader.String("model");
  const double alpha = reader.Number("alpha");
  const Eigen::Vector3d f0 = Eigen::Vector3d::Constant(reader.Number("f0"));
  if (model == "ggx") {
    return Checked(reader, Ggx({.f0 = f0, .alpha = alpha}));
  }
  if (model == "ggx-anisotropic") {
    const double anisotropy = reader.Number("anisotropy");
    const Eigen::Vector3d tangent = Rgb(reader.Numbers("tangent", 3));
    return Checked(
        reader,
        GgxAnisotropic({.f0 = f0, .alpha = alpha, .anisotropy = anisotropy, .tangent = tangent}));
  }
  if (model == "beckmann") {
    return Checked(reader, Beckmann({.f0 = f0, .alpha = alpha}));
  }
  if (model == "cloth") {
    return Checked(reader, Cloth({.f0 = f0, .alpha = alpha}));
  }
  reader.Require(false, "model",
                 fmt::format("'{}'; need ggx, ggx-anisotropic, beckmann or cloth", model));
  return tl::unexpected(reader.Finish().error());
}

Result<Material> ReadMaterial(JsonReader reader) {
  Material material;
  const std::optional<std::vector<double>> rgb = reader.OptionalNumbers("albedo", 3);
  std::optional<JsonReader> texture = reader.OptionalObject("texture");
  reader.Require(rgb.has_value() != texture.has_value(), "albedo",
                 "given together with texture, or neither; need one of them");
  material.yarn_variation = reader.OptionalNumber("yarn_variation").value_or(0.0);
  std::optional<JsonReader> specular = reader.OptionalObject("specular");
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  if (rgb) {
    material.albedo = ConstantAlbedo{Rgb(*rgb)};
  } else if (Result<Albedo> albedo = ReadTexture(std::move(*texture)); albedo) {
    material.albedo = std::move(*albedo);
  } else {
    return tl::unexpected(albedo.error());
  }
  if (specular) {
    Result<std::shared_ptr<const Brdf>> brdf = ReadSpecular(std::move(*specular));
    if (!brdf) {
      return tl::unexpected(brdf.error());
    }
    material.specular = std::move(*brdf);
  }
  return material;
}

Status ReadMaterials(JsonReader reader, Scene& scene) {
  for (const std::string_view part : scene.surface->Parts()) {
    if (part == "ground" && !reader.Has(part)) {
      scene.materials.push_back(
          {.albedo = ConstantAlbedo{Eigen::Vector3d::Constant(kGroundAlbedo)}});
      continue;
    }
    JsonReader one = reader.Object(part);
    Result<Material> material = ReadMaterial(std::move(one));
    if (!material) {
      return tl::unexpected(material.error());
    }
    scene.materials.push_back(std::move(*material));
  }
  return reader.Finish();
}

Status ReadIllumination(JsonReader reader, Illumination& illumination) {
  if (const auto shadows = reader.OptionalString("shadows")) {
    constexpr std::array<std::string_view, 3> kNames = {"none", "attached", "cast"};
    const auto* const found = std::ranges::find(kNames, *shadows);
    reader.Require(found != kNames.end(), "shadows",
                   fmt::format("'{}'; need none, attached or cast", *shadows));
    illumination.shadows = static_cast<Shadows>(found - kNames.begin());
  }
  if (reader.Has("shadow_samples")) {
    illumination.shadow_samples = reader.Integer("shadow_samples");
  }
  if (reader.Has("bounce_rays")) {
    illumination.bounce_rays = reader.Integer("bounce_rays");
  }
  if (const auto ambient = reader.OptionalNumbers("ambient_rgb", 3)) {
    illumination.ambient_rgb = Rgb(*ambient);
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
  if (reader.Has("samples")) {
    lens.samples = reader.Integer("samples");
  }
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
  if (reader.Has("bits")) {
    sensor.bits = reader.Integer("bits");
    sensor.white_dn = std::exp2(sensor.bits) - 1.0;
  }
  sensor.black_dn = reader.OptionalNumber("black").value_or(sensor.black_dn);
  sensor.white_dn = reader.OptionalNumber("white").value_or(sensor.white_dn);
  sensor.full_scale = reader.OptionalNumber("full_scale").value_or(sensor.full_scale);
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
  for (const auto& [key, value] : {std::pair{"exposure_s", exposure.exposure_s},
                                   {"f_number", exposure.f_number},
                                   {"iso", exposure.iso}}) {
    reader.Require(value > 0.0, key, fmt::format("{:g}; need more than 0", value));
  }
  return reader.Finish();
}

// The error of a value that a library refused, as one of this file's key.
Status InFile(const Status& status, const std::filesystem::path& path, std::string_view key) {
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
  const std::string kind = top.OptionalString("kind").value_or("fabric");
  constexpr std::array kKinds = {SessionKind::kFabric, SessionKind::kSheet, SessionKind::kChart,
                                 SessionKind::kBoard};
  const auto* const known_kind =
      std::ranges::find_if(kKinds, [&](SessionKind known) { return Name(known) == kind; });
  top.Require(known_kind != kKinds.end(), "kind",
              fmt::format("'{}'; need fabric, sheet, chart or board", kind));
  file.kind = known_kind != kKinds.end() ? *known_kind : SessionKind::kFabric;
  if (top.Has("seed")) {
    const int seed = top.Integer("seed");
    top.Require(seed >= 0, "seed", fmt::format("{}; need 0 or more", seed));
    file.scene.seed = static_cast<uint64_t>(std::max(seed, 0));
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
    status = InFile(ReadMaterials(materials, file.scene), path, "materials: specular.");
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
    return tl::unexpected(rig.error());
  }
  file.scene.rig = std::move(*rig);
  if (status = InFile(file.scene.Validate(), path, ""); !status) {
    return tl::unexpected(status.error());
  }
  if (file.kind == SessionKind::kSheet) {
    file.table_from_sheet = Eigen::Isometry3d::Identity();
    file.table_from_sheet->linear() =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(),
                                           file.scene.surface->At(0.0, 0.0).Normal())
            .toRotationMatrix();
  }
  return file;
}

}  // namespace sateen::cli
