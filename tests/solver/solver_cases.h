#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/angle.h"
#include "imaging/light_stack.h"
#include "rig/light.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "solver/evaluate.h"
#include "solver/lambertian.h"

// Stacks with known answers for the tests of the solver.
namespace sateen::testing {

// Half the distance from 1 to the next float: the largest relative error of a rounded sample.
inline constexpr double kFloatUnit = 0x1p-24;

inline constexpr std::array kAllBackends = {Backend::kJacobiSvd, Backend::kQr, Backend::kLdlt,
                                            Backend::kFast, Backend::kAuto};

// Angle in degrees that rounding samples and result to float may cost a least-squares normal:
//
//     |dN| <= |di| / sigma_min <= u |N| sqrt(K) / sigma_min <= sqrt(3) u cond |N|,
//
// because sigma_max^2 >= trace(L^T L) / 3 = K / 3; and sqrt(3) u for the three rounded components.
inline double RoundingBoundDeg(double condition) {
  return std::numbers::sqrt3 * kFloatUnit * (condition + 1.0) * kDegPerRad;
}

inline RenderedRelief Render(const Rig& rig, ImageSize size, double max_slope_deg = 30.0,
                             ReliefShape shape = ReliefShape::kRipple) {
  return RenderRelief({.shape = shape, .max_slope_rad = max_slope_deg * kRadPerDeg}, rig, size)
      .value();
}

inline Rig DistantRig(Lights lights) {
  Rig rig;
  rig.lights = std::move(lights);
  return rig;
}

inline double ConditionOf(const Lights& lights) {
  Eigen::MatrixX3d l(static_cast<Eigen::Index>(lights.size()), 3);
  for (size_t k = 0; k < lights.size(); ++k) {
    l.row(static_cast<Eigen::Index>(k)) = lights[k].direction.transpose();
  }
  const Eigen::VectorXd sigma = l.jacobiSvd().singularValues();
  return sigma[0] / sigma[2];
}

// Multiplies every sample of every frame.
inline void ScaleRadiance(LightStack& stack, float factor) {
  for (LightFrame& frame : stack) {
    for (Image<float>& plane : frame.rgb.planes) {
      for (float& value : plane.pixels) {
        value *= factor;
      }
    }
  }
}

inline void SetSample(LightFrame& frame, size_t pixel, float value) {
  for (Image<float>& plane : frame.rgb.planes) {
    plane.pixels[pixel] = value;
  }
}

inline Reason ReasonAt(const NormalField& field, size_t pixel) {
  return static_cast<Reason>(field.reason.pixels[pixel]);
}

inline bool SameBits(const NormalField& a, const NormalField& b) {
  bool same = a.residual.pixels == b.residual.pixels && a.samples.pixels == b.samples.pixels &&
              a.reason.pixels == b.reason.pixels;
  for (size_t c = 0; c < 3; ++c) {
    same = same && a.normal[c].pixels == b.normal[c].pixels &&
           a.albedo[c].pixels == b.albedo[c].pixels;
  }
  return same;
}

}  // namespace sateen::testing
