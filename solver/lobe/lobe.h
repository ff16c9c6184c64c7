#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "solver/least_squares/pixel_system.h"
#include "solver/lobe/lobe_term.h"
#include "solver/noise.h"

namespace sateen {

// One pixel's normal under a lobe, in double.
struct LobeAnswer {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();       // N of the body's luminance; zero: no answer
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();  // of the body
  double residual = 0.0;                             // RMS of the luminance
  double uncertainty_deg = 0.0;
  double albedo_uncertainty = 0.0;
  double lobe_share = 0.0;  // what the lobe reflects over what the body does
  double misfit = 0.0;      // chi^2 over its degrees of freedom
};

// A pixel's usable samples: n x 3 directions, n x 4 i' of red, green, blue and luminance, 1 / variance of
// the luminance, s^2 included, and the unit vector to the camera. It is explained where its misfit is at most
// `limit`.
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

// Of a pixel of a stack, weighted by (1) of solver/ladder.h; `limit` as MisfitLimits() has it, with s^2.
[[nodiscard]] LobeSamples LobeSamplesOf(const PixelSystem& system, const StackNoise& noise,
                                        double scale_squared, const Eigen::Vector3d& v,
                                        double limit);

/// Equation (14): Gauss-Newton with the analytic gradient of (13), its steps halved where they would make
/// the misfit larger. From least squares; where that does not end within the limit, also from least squares
/// of the darker half of the samples, which a highlight is not in, and from the normal that mirrors the
/// brightest lights. Of yarns the better of two, whose fibres lie across each other.
///
/// Cost   3 to 6 microseconds of ten samples, of yarns twice that
[[nodiscard]] LobeAnswer SolveLobe(const LobeSamples& samples, const Lobe& lobe);

// What a cloth differs by from the lobe it is given: half a degree, of the albedo as much, and that part of
// the lobe itself.
inline constexpr double kLobeUncertainty = 0.00872664626;
inline constexpr double kUncertaintyOfLobe = 0.1;
// Fewer samples leave too little to tell body from lobe: no answer.
inline constexpr int kFewestForLobe = 6;

// That the lobe is on a pixel, by its chi^2 over its degrees of freedom without and with it and by the share
// of all pixels that have it.
[[nodiscard]] double LobeProbability(double misfit_without, double misfit_with, int freedom,
                                     double share);
inline constexpr double kLeastShare = 0.01;  // of either

// From the table point that pixel (column, row) sees to the camera; nothing without a pose.
[[nodiscard]] std::optional<Eigen::Vector3d> ViewOf(const Rig& rig, int column, int row);

}  // namespace sateen
