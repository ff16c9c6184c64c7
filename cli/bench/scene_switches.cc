#include "cli/bench/scene_switches.h"

#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "core/angle.h"
#include "reflectance/specular.h"
#include "simulation/rigs.h"
#include "simulation/weave.h"

namespace sateen::cli {
namespace {

constexpr double kWidthMm = 120.0;  // of the picture
constexpr double kPeriodMm = 25.0;  // of the waves
constexpr double kMaxSlopeRad = 55.0 * kRadPerDeg;
constexpr double kUnderExposed = 400.0;  // radiance that saturates the noisy sensor

template <typename Model, typename Spec>
std::function<void(Scene&)> Specular(Spec spec) {
  return [spec](Scene& scene) {
    scene.materials[0].specular = std::make_shared<const Model>(Model(spec));
  };
}

}  // namespace

Result<Scene> PlainScene(ImageSize size) {
  Result<SurfacePtr> waves = MakeWaves(kPeriodMm, kMaxSlopeRad);
  if (!waves) {
    return tl::unexpected(waves.error());
  }
  Scene scene;
  scene.rig = RingRig(size, LightModel::kNear, kWidthMm);
  scene.surface = std::move(*waves);
  scene.materials = {{.albedo = ConstantAlbedo{{0.7, 0.63, 0.52}}}};
  return scene;
}

std::vector<SceneSwitch> SceneSwitches() {
  Sensor noisy = *SensorNamed("nikon-d5100");
  noisy.full_scale = kUnderExposed;
  return {
      {"plain: near lights, Lambert", "plain"},
      {"lights distant", "distant",
       [](Scene& scene) { scene.rig.lights = DistantRing(10, 45.0 * kRadPerDeg); }},
      {"lights led, anisotropy 20", "led",
       [](Scene& scene) {
         for (Light& light : scene.rig.lights) {
           light.model = LightModel::kLed;
           light.axis = -light.position_mm.normalized();
           light.anisotropy = 20.0;
         }
       }},
      {"flux_rgb of warm LEDs", "warm",
       [](Scene& scene) {
         for (Light& light : scene.rig.lights) {
           light.flux_rgb = light.flux_rgb.cwiseProduct(Eigen::Vector3d(1.0, 0.75, 0.45));
         }
       }},
      {"shadows none", "shadows-none",
       [](Scene& scene) { scene.illumination.shadows = Shadows::kNone; }},
      {"shadows cast, 3 x 3", "shadows-cast",
       [](Scene& scene) { scene.illumination.shadows = Shadows::kCast; }},
      {"bounce_rays 64", "bounce", [](Scene& scene) { scene.illumination.bounce_rays = 64; }},
      {"ambient_rgb 0.1", "ambient",
       [](Scene& scene) { scene.illumination.ambient_rgb.setConstant(0.1); }},
      {"flicker 0.2", "flicker", [](Scene& scene) { scene.illumination.flicker = 0.2; }},
      {"dead, the last light", "dead",
       [](Scene& scene) { scene.illumination.dead = {scene.rig.lights.back().name}; }},
      {"specular ggx 0.3", "ggx", Specular<Ggx>(SpecularSpec{.alpha = 0.3})},
      {"specular ggx-anisotropic", "ggx-anisotropic",
       Specular<GgxAnisotropic>(AnisotropicSpec{.alpha = 0.5, .anisotropy = 0.8})},
      {"specular beckmann 0.3", "beckmann", Specular<Beckmann>(SpecularSpec{.alpha = 0.3})},
      {"specular cloth 0.6, f0 0.3", "cloth",
       Specular<Cloth>(SpecularSpec{.f0 = Eigen::Vector3d::Constant(0.3), .alpha = 0.6})},
      {"distortion k1 -0.3", "distortion",
       [](Scene& scene) { scene.rig.camera->distortion[0] = -0.3; }},
      {"vignetting -0.5", "vignetting",
       [](Scene& scene) {
         scene.lens.vignetting = {-0.5, 0.0, 0.0};
       }},
      {"psf_sigma_px 3", "psf", [](Scene& scene) { scene.lens.psf_sigma_px = 3.0; }},
      {"texture waves", "texture-waves",
       [](Scene& scene) {
         scene.materials[0].albedo = WavyAlbedo{.min = 0.2, .max = 0.8, .period_mm = 80.0};
       }},
      {"texture patches", "texture-patches",
       [](Scene& scene) {
         scene.materials[0].albedo =
             PatchesAlbedo{.values = {0.9, 0.6, 0.36, 0.2, 0.1, 0.03}, .patch_mm = 18.0};
       }},
      {"samples 3, print", "samples",
       [](Scene& scene) {
         scene.materials[0].albedo =
             PrintAlbedo{.print = PrintOf({.columns = 10, .rows = 10, .square_mm = 10.0})};
         scene.lens.samples = 3;
       }},
      {"bump from the 6th, 12 px", "bump",
       [](Scene& scene) {
         scene.lens.bump_from = scene.rig.lights[scene.rig.lights.size() / 2].name;
         scene.lens.bump_px = {12.0, 0.0};
       }},
      {"sensor D5100, 9 stops under", "noise", [](Scene&) {}, noisy},
  };
}

std::vector<SceneShape> SceneShapes() {
  const auto weave = [](std::string_view pattern, double edge_deg, double amplitude_mm) {
    const WeaveSpec spec{.pattern = *WeavePatternNamed(pattern),
                         .pitch_mm = 1.6,
                         .fill = 0.9,
                         .edge_rad = edge_deg * kRadPerDeg,
                         .amplitude_mm = amplitude_mm};
    return SceneShape{pattern, 20.0, [spec] { return MakeWeave(spec); }};
  };
  return {
      {"plane", 120.0, [] { return MakePlane(0.0, 0.0); }},
      {"tilted-plane", 120.0, [] { return MakePlane(25.0 * kRadPerDeg, 0.6); }},
      {"sphere", 120.0, [] { return MakeSphereCap(55.0, 60.0 * kRadPerDeg); }},
      {"groove", 40.0, [] { return MakeGroove(8.0, 70.0 * kRadPerDeg); }},
      {"steps", 40.0, [] { return MakeSteps(4, 7.0, 1.5, 1.0); }},
      {"waves", 120.0, [] { return MakeWaves(kPeriodMm, kMaxSlopeRad); }},
      {"height-map", 20.0,
       [] {
         Image<float> height(100, 100);  // a hundred bumps, as a file might hold them
         for (int y = 0; y < height.height; ++y) {
           for (int x = 0; x < height.width; ++x) {
             const double bump =
                 std::sin(0.1 * std::numbers::pi * x) * std::sin(0.1 * std::numbers::pi * y);
             height.At(x, y) = static_cast<float>(0.4 * bump * bump * bump * bump);
           }
         }
         return MakeHeightMap(std::move(height), 0.2);
       }},
      weave("plain", 45.0, 0.12),
      weave("twill", 40.0, 0.12),
      weave("satin", 35.0, 0.08),
      weave("rib", 50.0, 0.2),
      weave("knit", 50.0, 0.12),
  };
}

Result<Scene> ShapeScene(const SceneShape& shape, ImageSize size) {
  Result<SurfacePtr> surface = shape.make();
  if (!surface) {
    return tl::unexpected(surface.error());
  }
  Scene scene;
  scene.rig = RingRig(size, LightModel::kNear, shape.width_mm);
  scene.surface = std::move(*surface);
  scene.illumination.shadows = Shadows::kCast;
  for (const std::string_view part : scene.surface->Parts()) {
    const Eigen::Vector3d rgb = part == "ground" ? Eigen::Vector3d(0.03, 0.03, 0.03)
                                : part == "weft" ? Eigen::Vector3d(0.75, 0.7, 0.6)
                                                 : Eigen::Vector3d(0.45, 0.5, 0.6);
    Material& material = scene.materials.emplace_back();
    material.albedo = ConstantAlbedo{rgb};
    material.yarn_variation = 0.2;
  }
  return scene;
}

}  // namespace sateen::cli
