#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibration/check/check_model.h"
#include "calibration/check/check_settle.h"
#include "calibration/check/rig_change.h"
#include "core/task.h"

namespace sateen {

// Change that explains the sheets, and how well it is known.
struct ChangeFit {
  RigChange change;
  double chi2 = 0.0;  // of the residuals and the priors
  // Covariances per light and of the camera; zero where the unknown was not free.
  std::vector<Eigen::Matrix3d> flux;  // of log_flux
  std::vector<Eigen::Matrix3d> moved_mm2;
  std::vector<Eigen::Matrix2d> turned_rad2;
  Eigen::Matrix4d camera = Eigen::Matrix4d::Zero();
};

/// Fits the free unknowns of a change to the sheets, by at most five steps of Gauss and Newton's
/// method,
///
///     argmin  sum_jkc w_jk r_jkc^2 + sum_i (x_i / s_i)^2                                      (1)
///
/// with r of equation (1) of check_model.h, and x_i the free unknowns with the standard deviations
/// s_i of their priors (check_unknowns.h). The covariance is the inverse of the normal matrix.
///
/// start    where the first step begins
/// Cost     the normal equations of CheckModel per step, and one LDLT of all free unknowns
[[nodiscard]] ChangeFit FitChange(const CheckModel& model, const SampleWeights& weights,
                                  const ChangeMask& mask, const RigChange& start, const Task& task);

// Fall of chi2 if one light alone moved or turned further, its flux following.
struct ChangeGain {
  double moved = 0.0;
  double turned = 0.0;
  Eigen::Matrix3d moved_mm2 = Eigen::Matrix3d::Zero();  // covariance of that move
};

/// Returns the gain of each light, from one step of Gauss and Newton's method; zero for those that
/// take no part.
[[nodiscard]] std::vector<ChangeGain> GainsOf(const CheckModel& model, const SampleWeights& weights,
                                              const ChangeFit& fit, const Task& task);

}  // namespace sateen
