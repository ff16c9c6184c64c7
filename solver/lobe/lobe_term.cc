#include "solver/lobe/lobe_term.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/angle.h"

namespace sateen {
namespace {

constexpr double kLobeF0 = 0.04;
constexpr double kLeastViewCosine = 1e-4;    // as reflectance/specular.h has it
constexpr double kLeastSineSquared = 1e-4;   // between n and h; below it velvet is flat
constexpr double kLeastTangentPart = 1e-12;  // squared length of the tangent in the surface

// Factor of the lobe and its derivative.
struct Factor {
  double value;
  double slope;
};

// Returns VelvetDistribution of reflectance/microfacet.h as a function of n . h.
Factor VelvetOf(double n_h, double alpha) {
  const double unit = 1.0 / (std::numbers::pi * (1.0 + 4.0 * alpha * alpha));
  const double q = 1.0 - n_h * n_h;
  if (q < kLeastSineSquared) {
    return {unit, 0.0};
  }
  const double e = std::exp(-n_h * n_h / (q * alpha * alpha)) / (q * q);
  return {unit * (1.0 + 4.0 * e),
          unit * 4.0 * e * (4.0 * n_h / q - 2.0 * n_h / (alpha * alpha * q * q))};
}

// Returns x + sqrt(x^2 + alpha^2 (1 - x^2)). Smith's masking is 2 x over this.
Factor SmithOf(double x, double alpha) {
  const double a = alpha * alpha;
  const double root = std::sqrt(x * x * (1.0 - a) + a);
  return {x + root, 1.0 + x * (1.0 - a) / root};
}

}  // namespace

LobeHalf LobeHalfOf(const Eigen::Vector3d& l, const Eigen::Vector3d& v) {
  const Eigen::Vector3d h = (l + v).normalized();
  const double beyond = 1.0 - std::clamp(v.dot(h), 0.0, 1.0);
  const double squared = beyond * beyond;
  return {h, kLobeF0 + (1.0 - kLobeF0) * squared * squared * beyond};
}

LobeShape::LobeShape(const Lobe& lobe)
    : lobe_(lobe),
      tangent_(std::cos(lobe.azimuth_deg * kRadPerDeg), std::sin(lobe.azimuth_deg * kRadPerDeg),
               0.0) {}

// D = 1 / (pi alpha_t alpha_b u^2), u = (t.h / alpha_t)^2 + (b.h / alpha_b)^2 + (n.h)^2.
LobeTerm LobeShape::DistributionAt(const Eigen::Vector3d& n, const Eigen::Vector3d& h) const {
  const double n_h = std::clamp(n.dot(h), 0.0, 1.0);
  const double of_t = 1.0 / (lobe_.alpha * lobe_.alpha);
  if (lobe_.model == LobeModel::kGgx) {
    const double u = (1.0 - n_h * n_h) * of_t + n_h * n_h;
    const double d = of_t / (std::numbers::pi * u * u);
    return {d, (-4.0 * d / u * n_h * (1.0 - of_t)) * h};
  }
  const double of_b = 1.0 / (lobe_.alpha_along * lobe_.alpha_along);
  const double n_t = n.dot(tangent_);
  const double q = 1.0 / std::max(1.0 - n_t * n_t, kLeastTangentPart);
  const double w = tangent_.dot(h) - n_t * n_h;
  const double t_h_squared = w * w * q;
  const double u = t_h_squared * of_t + (1.0 - n_h * n_h - t_h_squared) * of_b + n_h * n_h;
  const double d = 1.0 / (std::numbers::pi * lobe_.alpha * lobe_.alpha_along * u * u);
  const double of_u = -2.0 * d / u;
  const double of_t_h = of_u * (of_t - of_b) * 2.0 * w * q;
  return {d, (of_u * 2.0 * n_h * (1.0 - of_b) - of_t_h * n_t) * h +
                 (of_t_h * (w * q * n_t - n_h)) * tangent_};
}

LobeTerm LobeShape::At(const Eigen::Vector3d& n, const Eigen::Vector3d& l, const Eigen::Vector3d& v,
                       const LobeHalf& half) const {
  const double n_l = n.dot(l);
  if (n_l <= 0.0) {
    return {};
  }
  const double n_v = std::max(n.dot(v), kLeastViewCosine);
  const double along_v = n.dot(v) > kLeastViewCosine ? 1.0 : 0.0;  // of the gradient
  const double unit = lobe_.strength * std::numbers::pi * half.fresnel;
  if (lobe_.model == LobeModel::kCloth) {
    const Factor d = VelvetOf(std::clamp(n.dot(half.h), 0.0, 1.0), lobe_.alpha);
    const double g = 4.0 * (n_l + n_v - n_l * n_v);
    const double value = unit * d.value * n_l / g;
    return {value, unit * d.slope * n_l / g * half.h + unit * d.value / g * l -
                       value / g * 4.0 * ((1.0 - n_v) * l + along_v * (1.0 - n_l) * v)};
  }
  const LobeTerm d = DistributionAt(n, half.h);
  const Factor of_l = SmithOf(n_l, lobe_.alpha);
  const Factor of_v = SmithOf(n_v, lobe_.alpha);
  const double visibility = unit / (of_l.value * of_v.value);
  const double value = d.value * visibility * n_l;
  return {value, visibility * n_l * d.gradient +
                     (d.value * visibility - value * of_l.slope / of_l.value) * l -
                     (value * along_v * of_v.slope / of_v.value) * v};
}

}  // namespace sateen
