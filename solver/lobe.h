#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "solver/least_squares.h"
#include "solver/lobe_term.h"
#include "solver/noise.h"
#include "solver/pixel_system.h"

namespace sateen {

// One pixel's normal under a lobe, in double.
struct LobeAnswer {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();       // N of the body's luminance; zero: no answer
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();  // of the body
  double residual = 0.0;                             // RMS of the luminance
  double uncertainty_deg = 0.0;                      // with s = 1
  double albedo_uncertainty = 0.0;
  double lobe_share = 0.0;  // what the lobe reflects over what the body does
  double misfit = 0.0;      // chi^2 over its degrees of freedom
};

// A pixel's usable samples: n x 3 directions, n x 4 i' of red, green, blue and luminance, 1 / variance of
// the luminance, and the unit vector to the camera. It is explained where its misfit is at most `limit`.
struct LobeSamples {
  // Fills in `halves`.
  LobeSamples(Eigen::MatrixX3d directions, Eigen::MatrixX4d samples, Eigen::VectorXd by_variance,
              const Eigen::Vector3d& to_camera, double misfit_limit);

  Eigen::MatrixX3d l;
  Eigen::MatrixX4d i;
  Eigen::VectorXd weights;
  Eigen::Vector3d v;
  double limit;
  std::vector<LobeHalf> halves;  // of each light
};

// Of a pixel of a stack, weighted by (1) of solver/ladder.h.
[[nodiscard]] LobeSamples LobeSamplesOf(const PixelSystem& system, const StackNoise& noise,
                                        const Eigen::Vector3d& v, double limit);

/// Equation (14): Gauss-Newton with the analytic gradient of (13), its steps halved where they would make
/// the misfit larger. From least squares; where that does not end within the limit, also from least squares
/// of the darker half of the samples, which a highlight is not in, and from the normal that mirrors the
/// brightest lights. Of yarns the better of two, whose fibres lie across each other.
///
/// Cost   3 to 6 microseconds of ten samples, of yarns twice that
[[nodiscard]] LobeAnswer SolveLobe(const LobeSamples& samples, const Lobe& lobe);

// Equation (15) over these pixels; nothing where no lobe explains 70 of 100, or where it is little
// better than none.
[[nodiscard]] std::optional<Lobe> SearchLobe(const std::vector<LobeSamples>& pixels, int threads);

// Pixels that SearchLobe() is to be given, fewer samples that leave too little to tell body from lobe,
// and the share of pixels that rung 1 has to explain so that no lobe is looked for.
inline constexpr size_t kLobePixels = 384;
inline constexpr int kFewestForLobe = 6;
inline constexpr double kWellExplained = 0.8;

// The lobe that explains a sample of pixels of which plain least squares leave many unexplained;
// nothing where none does, or where there is no camera to say from where the surface is seen. A pixel
// is explained where its misfit is at most limit[its usable samples].
[[nodiscard]] std::optional<Lobe> FindLobe(const LightStack& stack, const Rig& rig,
                                           const LambertianOptions& options,
                                           const StackNoise& noise, const MisfitSample& sample,
                                           const std::array<float, 256>& limit, int threads);

// From the table point that pixel (column, row) sees to the camera; nothing without a pose.
[[nodiscard]] std::optional<Eigen::Vector3d> ViewOf(const Rig& rig, int column, int row);

}  // namespace sateen
