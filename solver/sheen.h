#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "solver/least_squares.h"
#include "solver/noise.h"
#include "solver/pixel_system.h"

namespace sateen {

// Rung 3 of solver/ladder.h: fuzz that a whole scene has in common, over a Lambertian body.
struct Sheen {
  double alpha = 0.0;     // roughness of reflectance/specular.h's Cloth
  double strength = 0.0;  // times Cloth of F0 = 0.04
};

// One pixel's normal under a sheen, in double.
struct SheenAnswer {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();       // N of the body's luminance; zero: no answer
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();  // of the body
  double residual = 0.0;                             // RMS of the luminance
  double uncertainty_deg = 0.0;                      // with s = 1
  double misfit = 0.0;                               // chi^2 over its degrees of freedom
};

// Equations (13) and (14), from the usable samples of `system` and the unit vector v to the camera.
[[nodiscard]] SheenAnswer SolveSheen(const PixelSystem& system, const StackNoise& noise,
                                     const Sheen& sheen, const Eigen::Vector3d& v);

// The sheen that explains a sample of pixels of which plain least squares leave many unexplained;
// nothing where none does, or where there is no camera to say from where the surface is seen. A pixel
// is explained where its misfit is at most limit[its usable samples].
[[nodiscard]] std::optional<Sheen> FindSheen(const LightStack& stack, const Rig& rig,
                                             const LambertianOptions& options,
                                             const StackNoise& noise, const MisfitSample& sample,
                                             const std::array<float, 256>& limit);

// From the table point that pixel (column, row) sees to the camera; nothing without a pose.
[[nodiscard]] std::optional<Eigen::Vector3d> ViewOf(const Rig& rig, int column, int row);

}  // namespace sateen
