#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "reflectance/specular.h"
#include "scanner/checks/capture_check.h"
#include "simulation/random.h"
#include "simulation/render.h"
#include "simulation/rigs.h"
#include "simulation/sensor.h"
#include "simulation/weave.h"

// Sessions as the checks see them, without files: rendered once a fabric, noise anew each time.
namespace sateen::testing {

inline constexpr ImageSize kLookPx = {160, 120};
inline constexpr BlockGrid kLookGrid = {.columns = 24, .rows = 16};
inline constexpr size_t kLookLights = 10;

inline Rig CalibratedRig() {
  Rig rig = RingRig(kLookPx, LightModel::kLed);
  rig.calibration.lights.emplace();
  return rig;
}

// By the ruler: each light is `wrong_mm` from where it is said to be.
inline Rig RoughRig(Rig rig, double wrong_mm, uint64_t seed) {
  rig.calibration = {};
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    Eigen::Vector3d direction;
    for (uint64_t axis = 0; axis < 3; ++axis) {
      direction[static_cast<Eigen::Index>(axis)] = NormalDeviate(HashOf(seed, k), axis);
    }
    rig.lights[k].position_mm += wrong_mm * direction.normalized();
  }
  return rig;
}

inline Scene SceneOf(const std::string& fabric, const Rig& rig) {
  Scene scene;
  scene.rig = rig;
  const Material wavy{.albedo = WavyAlbedo{.min = 0.2, .max = 0.7, .period_mm = 19.0}};
  const Material printed{.albedo = PatchesAlbedo{.values = {0.2, 0.9, 0.4, 0.7}}};
  if (fabric == "print") {  // flat cloth, printed
    scene.surface = *MakePlane(0.0, 0.0);
    scene.materials = {printed};
  } else if (fabric == "ripples") {  // cloth that does not lie flat
    scene.surface = *MakeWaves(70.0, 0.25);
    scene.materials = {printed};
  } else if (fabric == "velvet") {
    scene.surface = *MakeWaves(90.0, 0.1);
    scene.materials = {wavy};
    scene.materials[0].specular = std::make_shared<const Cloth>(
        SpecularSpec{.f0 = Eigen::Vector3d::Constant(0.1), .alpha = 0.5});
  } else {
    scene.surface = *MakeWeave({.pattern = *WeavePatternNamed(fabric), .pitch_mm = 9.0});
    scene.materials.assign(scene.surface->Parts().size(), wavy);
  }
  if (fabric == "satin") {
    for (Material& material : scene.materials) {
      material.specular = std::make_shared<const Ggx>(
          SpecularSpec{.f0 = Eigen::Vector3d::Constant(0.06), .alpha = 0.4});
    }
  }
  return scene;
}

// The frames of one fabric without noise.
struct Fabric {
  Fabric(const std::string& name, const Rig& rig, const Eigen::Vector2d& nudge_px)
      : Fabric(WithShadows(SceneOf(name, rig)), nudge_px) {}
  Fabric(Scene scene, const Eigen::Vector2d& nudge_px) {
    SceneRenderer renderer = *SceneRenderer::Create(scene);
    for (size_t k = 0; k < kLookLights; ++k) {
      lit.push_back(renderer.Render(k)->radiance);
    }
    dark = renderer.Render(std::nullopt)->radiance;
    normal = renderer.Maps().normal;
    scene.lens.bump_from = scene.rig.lights[0].name;
    scene.lens.bump_px = nudge_px;
    SceneRenderer bumped = *SceneRenderer::Create(scene);
    for (size_t k = 0; k < kLookLights; ++k) {
      nudged.push_back(bumped.Render(k)->radiance);
    }
  }
  // Each square of 2 x 2 pixels joined to one.
  void Bin() {
    for (Image3& frame : lit) {
      frame = Binned(frame);
    }
    for (Image3& frame : nudged) {
      frame = Binned(frame);
    }
    dark = Binned(dark);
    normal = Binned(normal);
    for (size_t p = 0; p < normal[0].pixels.size(); ++p) {
      const float length =
          Eigen::Vector3f(normal[0].pixels[p], normal[1].pixels[p], normal[2].pixels[p]).norm();
      for (Image<float>& plane : normal.planes) {
        plane.pixels[p] /= length;
      }
    }
  }
  static Image3 Binned(const Image3& image) {
    Image3 binned(ImageSize{image.Size().width / 2, image.Size().height / 2});
    for (size_t c = 0; c < 3; ++c) {
      for (int y = 0; y < image.Size().height; ++y) {
        for (int x = 0; x < image.Size().width; ++x) {
          binned[c].At(x / 2, y / 2) += 0.25F * image[c].At(x, y);
        }
      }
    }
    return binned;
  }
  static Scene WithShadows(Scene scene) {
    scene.illumination.shadows = Shadows::kCast;
    scene.illumination.shadow_samples = 1;
    scene.lens.psf_sigma_px = 0.8;  // or yarns of a few pixels would alias
    scene.lens.samples = 3;         // or an edge of a print could move by whole pixels only
    return scene;
  }
  std::vector<Image3> lit;
  std::vector<Image3> nudged;
  Image3 dark;
  Image3 normal;
};

inline Image3 Mixed(const Image3& a, float by, const Image3& b, float times) {
  Image3 mixed = a;
  for (size_t c = 0; c < 3; ++c) {
    for (size_t p = 0; p < mixed[c].pixels.size(); ++p) {
      mixed[c].pixels[p] = by * a[c].pixels[p] + times * b[c].pixels[p];
    }
  }
  return mixed;
}

// A look of a mosaic as fractions of the range.
inline FrameLook LookOf(const Image<float>& mosaic, const std::array<uint8_t, 4>& cfa) {
  FrameLook look{.means = {.size_px = mosaic.Size(), .grid = kLookGrid}};
  AddToMiddle(mosaic, 1.0F, 1.0, look.middle);
  look.means.blocks.resize(static_cast<size_t>(kLookGrid.columns) *
                           static_cast<size_t>(kLookGrid.rows));
  for (int y = 0; y < mosaic.height; ++y) {
    for (int x = 0; x < mosaic.width; ++x) {
      const float value = mosaic.At(x, y);
      const auto colour = static_cast<Eigen::Index>(cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]);
      const int block = y * kLookGrid.rows / mosaic.height * kLookGrid.columns +
                        x * kLookGrid.columns / mosaic.width;
      look.means.blocks[static_cast<size_t>(block)].radiance_rgb[colour] +=
          static_cast<double>(value);
    }
  }
  return look;
}

// Returns a frame of the radiance as the checks see it, with noise of a sensor at a quarter of its
// range.
inline FrameLook LookAt(const Image3& radiance, uint64_t seed) {
  Sensor sensor = *SensorNamed("nikon-d5100");
  sensor.full_scale = 1.5;
  const Image<uint16_t> dn = *Expose(sensor, radiance, seed, {.threads = 1});
  Image<float> mosaic(dn.Size());
  std::ranges::transform(dn.pixels, mosaic.pixels.begin(), [&](uint16_t value) {
    return static_cast<float>((value - sensor.black_dn) / (sensor.white_dn - sensor.black_dn));
  });
  return LookOf(mosaic, sensor.cfa);
}

// The looks of one session; what a fault changes is put in place of it.
struct SessionLooks : CaptureLooks {
  SessionLooks(const Fabric& fabric, uint64_t seed) {
    for (size_t k = 0; k < kLookLights; ++k) {
      lit.push_back(LookAt(fabric.lit[k], HashOf(seed, k)));
    }
    dark_first = LookAt(fabric.dark, HashOf(seed, 100));
    dark_last = LookAt(fabric.dark, HashOf(seed, 101));
    repeat = LookAt(fabric.lit[0], HashOf(seed, 102));
  }
  // Camera or fabric are nudged before the frame of light `from`; kLookLights: before the repeat.
  void Nudge(const Fabric& fabric, size_t from, uint64_t seed) {
    for (size_t k = from; k < kLookLights; ++k) {
      lit[k] = LookAt(fabric.nudged[k], HashOf(seed, 300 + k));
    }
    repeat = LookAt(fabric.nudged[0], HashOf(seed, 399));
  }
};

// The shadow of a passer-by: a disc, half a plane or a strip with soft edges, over `share` of the
// picture, takes `amount` of the light.
struct PassersShadow {
  int kind = 0;
  double share = 0.0;
  double amount = 0.0;
  double soft = 0.0;  // width of its edge, of the picture's width
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  double angle_rad = 0.0;

  explicit PassersShadow(uint64_t seed)
      : kind(static_cast<int>(HashOf(seed, 0) % 3)),
        share(0.03 + 0.57 * UniformDeviate(seed, 1)),
        amount(0.25 + 0.75 * UniformDeviate(seed, 2)),
        soft(0.02 + 0.13 * UniformDeviate(seed, 3)),
        place(UniformDeviate(seed, 4), UniformDeviate(seed, 5)),
        angle_rad(2.0 * std::numbers::pi * UniformDeviate(seed, 6)) {}

  [[nodiscard]] double InsideAt(double x, double y, ImageSize size) const {
    const Eigen::Vector2d from(x - place.x() * size.width, y - place.y() * size.height);
    const double along = from.dot(Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)));
    return kind == 0 ? -from.norm() : kind == 1 ? along : -std::abs(along);
  }

  [[nodiscard]] Image3 On(Image3 radiance) const {
    const ImageSize size = radiance.Size();
    std::vector<double> inside;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        inside.push_back(InsideAt(x, y, size));
      }
    }
    std::vector<double> sorted = inside;
    std::ranges::sort(sorted, std::greater<>());
    const double edge = sorted[static_cast<size_t>(share * static_cast<double>(sorted.size()))];
    for (size_t p = 0; p < inside.size(); ++p) {
      const double t = std::clamp(0.5 + (inside[p] - edge) / (soft * size.width), 0.0, 1.0);
      const auto left = static_cast<float>(1.0 - amount * t * t * (3.0 - 2.0 * t));
      for (Image<float>& plane : radiance.planes) {
        plane.pixels[p] *= left;
      }
    }
    return radiance;
  }
};

}  // namespace sateen::testing
