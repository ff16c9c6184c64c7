#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/error.h"
#include "reflectance/brdf.h"
#include "rig/rig.h"
#include "simulation/surface.h"
#include "targets/print.h"

namespace sateen {

// Albedo over the table, RGB, each in [0, 1].
struct ConstantAlbedo {
  Eigen::Vector3d rgb = Eigen::Vector3d::Constant(0.5);
};
// Varies smoothly between two values, differently in each channel.
struct WavyAlbedo {
  double min = 0.3;
  double max = 0.8;
  double period_mm = 100.0;
};
// Albedo of a printed board or sheet (targets/print.h), in a plane over the table. On a surface
// that is not that plane, the print is seen from above.
struct PrintAlbedo {
  Print print;
  // Its frame: x right and y up as printed. Any z: a place (x, y) of the table shows what of the
  // plane is above or below it.
  Eigen::Isometry3d table_from_print = Eigen::Isometry3d::Identity();
  double dark = 0.04;
  double light = 0.9;
  std::optional<double> beyond = std::nullopt;  // the print's size; nothing: light
};
// A row of grey patches along x, centred on the table, on a ground of 0.18.
struct PatchesAlbedo {
  std::vector<double> values;
  double patch_mm = 20.0;
};
using Albedo = std::variant<ConstantAlbedo, WavyAlbedo, PrintAlbedo, PatchesAlbedo>;

[[nodiscard]] Eigen::Vector3d AlbedoAt(const Albedo& albedo, double x_mm, double y_mm);

// Material of one part of a surface: a Lambertian body and, where given, more on top.
struct Material {
  Albedo albedo;
  double yarn_variation = 0.0;           // albedo of each yarn is multiplied by 1 +- this; [0, 1)
  std::shared_ptr<const Brdf> specular;  // added to the body; nothing: Lambert alone
};

enum class Shadows {
  kNone,      // i = rho e n.l, also where that is negative: the solver's linear model
  kAttached,  // max(0, n.l)
  kCast       // and 0 where the surface is in the way
};

struct Illumination {
  Shadows shadows = Shadows::kAttached;
  int shadow_samples = 3;  // kCast: n x n places of a pixel at which the light is looked for
  int bounce_rays = 0;     // one-bounce inter-reflection from so many directions; 0: none
  Eigen::Vector3d ambient_rgb = Eigen::Vector3d::Zero();  // irradiance, also in the dark frame
  double flicker = 0.0;                                   // relative deviation of a light's flux
  std::vector<std::string> dead;                          // lights that stay dark
};

struct Lens {
  // Radiance is multiplied by 1 + v1 r^2 + v2 r^4 + v3 r^6, r = 1 in the corner.
  std::array<double, 3> vignetting = {};
  double psf_sigma_px = 0.0;  // Gaussian point spread; [0, 20]
  int samples = 1;            // n x n places of a pixel over which its albedo is averaged
  // From this light on the picture is shifted, as of a tripod that was bumped; empty: never.
  std::string bump_from;
  Eigen::Vector2d bump_px = Eigen::Vector2d::Zero();
};

// Everything that makes a simulated capture. All that is not asked for is off.
struct Scene {
  Rig rig;  // with a camera
  SurfacePtr surface;
  std::vector<Material> materials;  // one for each of surface->Parts()
  Illumination illumination;
  Lens lens;
  uint64_t seed = 1;

  // Fails with kInvalidArgument, which names the first thing out of range by its key in a scene
  // file.
  [[nodiscard]] Status Validate() const;
};

}  // namespace sateen
