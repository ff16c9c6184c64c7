#include "pipelines/simulate/scene_sample.h"

#include <algorithm>
#include <utility>

#include "core/angle.h"
#include "imaging/image_io.h"
#include "reflectance/specular.h"
#include "simulation/weave.h"

namespace sateen {
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
    return Fail(photo.error().code, "surface.file: {}", photo.error().message);
  }
  Image<float>& height = photo->rgb[0];
  for (float& z : height.pixels) {
    z *= static_cast<float>(scale_mm);
  }
  return MakeHeightMap(std::move(height), pitch_mm);
}

}  // namespace

Result<SurfacePtr> ReadSurface(JsonReader& reader, const std::filesystem::path& folder) {
  const std::string shape = reader.String("shape");
  const auto finished = [&](auto make) -> Result<SurfacePtr> {
    if (Status status = reader.Finish(); !status) {
      return tl::unexpected(status.error());
    }
    return make();
  };
  if (shape == "plane") {
    const double height_mm = reader.OptionalNumber("height_mm").value_or(0.0);
    return finished([&] { return MakePlane(0.0, 0.0, height_mm); });
  }
  if (shape == "tilted-plane") {
    const double slope_rad = Angle(reader, "slope_deg", 0.0, 90.0);
    const double azimuth_rad = Angle(reader, "azimuth_deg", -360.0, 360.0);
    const double height_mm = reader.OptionalNumber("height_mm").value_or(0.0);
    return finished([&] { return MakePlane(slope_rad, azimuth_rad, height_mm); });
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

Eigen::Isometry3d TableFromPlane(const Surface& plane) {
  const SurfacePoint at_origin = plane.At(0.0, 0.0);
  return Eigen::Translation3d(0.0, 0.0, at_origin.height_mm) *
         Eigen::Isometry3d(
             Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), at_origin.Normal()));
}

namespace {

// A print lies in the plane; on another shape it is seen from above.
Status ReadPrint(JsonReader& reader, const Surface& surface, Albedo& albedo) {
  const std::string target = reader.String("target");
  const double dark = reader.Number("dark");
  const double light = reader.Number("light");
  const std::optional<double> beyond = reader.OptionalNumber("beyond");
  const auto offset_mm = reader.OptionalNumbers("offset_mm", 2).value_or(std::vector{0.0, 0.0});
  const double turn_rad = reader.Has("turn_deg") ? Angle(reader, "turn_deg", -360.0, 360.0) : 0.0;
  Result<Print> print = PrintNamed(target);
  reader.Require(print.has_value(), "target", print ? "" : print.error().message);
  if (Status status = reader.Finish(); !status) {
    return status;
  }
  const Eigen::Isometry3d table_from_surface =
      surface.IsPlane() ? TableFromPlane(surface) : Eigen::Isometry3d::Identity();
  albedo = PrintAlbedo{.print = *std::move(print),
                       .table_from_print = table_from_surface *
                                           Eigen::Translation3d(offset_mm[0], offset_mm[1], 0.0) *
                                           Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()),
                       .dark = dark,
                       .light = light,
                       .beyond = beyond};
  return {};
}

Status ReadTexture(JsonReader reader, const Surface& surface, Albedo& albedo) {
  const std::string kind = reader.String("kind");
  if (kind == "waves") {
    albedo = WavyAlbedo{.min = reader.Number("min"),
                        .max = reader.Number("max"),
                        .period_mm = reader.Number("period_mm")};
  } else if (kind == "print") {
    return ReadPrint(reader, surface, albedo);
  } else if (kind == "patches") {
    const int count = reader.Integer("count");
    // The list as it is: room for `count` numbers would be made before they are counted.
    std::vector<double> values =
        reader.OptionalNumberList("values").value_or(std::vector<double>());
    reader.Require(std::cmp_equal(values.size(), count), "values",
                   fmt::format("has {} numbers; need {}, as count says", values.size(), count));
    albedo = PatchesAlbedo{.values = std::move(values), .patch_mm = reader.Number("patch_mm")};
  } else {
    reader.Require(false, "kind", fmt::format("'{}'; need waves, print or patches", kind));
  }
  return reader.Finish();
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
    const Eigen::Vector3d tangent = Eigen::Vector3d(reader.Numbers("tangent", 3).data());
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

Result<Material> ReadMaterial(JsonReader reader, const Surface& surface) {
  Material material;
  const std::optional<std::vector<double>> rgb = reader.OptionalNumbers("albedo", 3);
  std::optional<JsonReader> texture = reader.OptionalObject("texture");
  reader.Require(rgb || texture, "albedo", "is missing, and so is texture; need one of them");
  reader.Require(!rgb || !texture, "albedo", "stands beside texture; need one of them alone");
  material.yarn_variation = reader.OptionalNumber("yarn_variation").value_or(0.0);
  std::optional<JsonReader> specular = reader.OptionalObject("specular");
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  if (rgb) {
    material.albedo = ConstantAlbedo{Eigen::Vector3d(rgb->data())};
  } else if (Status status = ReadTexture(std::move(*texture), surface, material.albedo); !status) {
    return tl::unexpected(status.error());
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

}  // namespace

Status ReadMaterials(JsonReader reader, Scene& scene) {
  for (const std::string_view part : scene.surface->Parts()) {
    if (part == "ground" && !reader.Has(part)) {
      scene.materials.emplace_back().albedo =
          ConstantAlbedo{Eigen::Vector3d::Constant(kGroundAlbedo)};
      continue;
    }
    JsonReader one = reader.Object(part);
    Result<Material> material = ReadMaterial(std::move(one), *scene.surface);
    if (!material && material.error().code == ErrorCode::kInvalidArgument) {  // of the BRDF
      return Fail(ErrorCode::kInvalidArgument, "materials.{}.specular.{}", part,
                  material.error().message);
    }
    if (!material) {
      return tl::unexpected(material.error());
    }
    scene.materials.push_back(std::move(*material));
  }
  return reader.Finish();
}

}  // namespace sateen
