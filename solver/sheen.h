#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

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
  double albedo_uncertainty = 0.0;
  double misfit = 0.0;                               // chi^2 over its degrees of freedom
};

// A pixel's usable samples: n x 3 directions, n x 4 i' of red, green, blue and luminance, 1 / variance of
// the luminance, and the unit vector to the camera. It is explained where its misfit is at most `limit`.
struct SheenSamples {
  Eigen::MatrixX3d l;
  Eigen::MatrixX4d i;
  Eigen::VectorXd weights;
  Eigen::Vector3d v = Eigen::Vector3d::UnitZ();
  double limit = 0.0;
};

// Of a pixel of a stack, weighted by (1) of solver/ladder.h.
[[nodiscard]] SheenSamples SheenSamplesOf(const PixelSystem& system, const StackNoise& noise,
                                          const Eigen::Vector3d& v, double limit = 0.0);

// Equations (13) and (14).
[[nodiscard]] SheenAnswer SolveSheen(const SheenSamples& samples, const Sheen& sheen);

// Equation (15) over these pixels; nothing where no sheen explains 90 of 100, or where it is little
// better than none.
[[nodiscard]] std::optional<Sheen> SearchSheen(const std::vector<SheenSamples>& pixels);

// Pixels that SearchSheen() is to be given, fewer samples that leave too little to tell body from sheen,
// and the share of pixels that rung 1 has to explain so that no sheen is looked for.
inline constexpr size_t kSheenPixels = 96;
inline constexpr int kFewestForSheen = 6;
inline constexpr double kWellExplained = 0.8;

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
