#include "reflectance/microfacet.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sateen {
namespace {

constexpr double kPi = std::numbers::pi;

double Square(double x) { return x * x; }

double SmithRoot(double x, double alpha) {
  return std::sqrt(x * x + alpha * alpha * (1.0 - x * x));
}

}  // namespace

double GgxDistribution(double n_m, double alpha) {
  const double a2 = alpha * alpha;
  return a2 / (kPi * Square(n_m * n_m * (a2 - 1.0) + 1.0));
}

double GgxDistribution(const Eigen::Vector3d& m_in_tbn, double alpha_t, double alpha_b) {
  const double sum =
      Square(m_in_tbn.x() / alpha_t) + Square(m_in_tbn.y() / alpha_b) + Square(m_in_tbn.z());
  return 1.0 / (kPi * alpha_t * alpha_b * sum * sum);
}

double GgxMasking(double n_v, double alpha) { return 2.0 * n_v / (n_v + SmithRoot(n_v, alpha)); }

double GgxVisibility(double n_l, double n_v, double alpha) {
  return 1.0 / ((n_l + SmithRoot(n_l, alpha)) * (n_v + SmithRoot(n_v, alpha)));
}

double BeckmannDistribution(double n_m, double alpha) {
  const double cos2 = n_m * n_m;
  const double a2 = alpha * alpha;
  return std::exp(-(1.0 - cos2) / (cos2 * a2)) / (kPi * a2 * cos2 * cos2);
}

double BeckmannMasking(double n_v, double alpha) {
  const double sin2 = std::max(1.0 - n_v * n_v, 1e-30);
  const double a = n_v / (alpha * std::sqrt(sin2));
  if (a >= 1.6) {
    return 1.0;
  }
  return (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a);
}

double VelvetDistribution(double n_m, double alpha) {
  const double cos2 = n_m * n_m;
  const double sin2 = std::max(1.0 - cos2, 1e-30);
  const double a2 = alpha * alpha;
  const double lobe = 4.0 * std::exp(-cos2 / (sin2 * a2)) / (sin2 * sin2);
  return (1.0 + lobe) / (kPi * (1.0 + 4.0 * a2));
}

Eigen::Vector3d SchlickFresnel(const Eigen::Vector3d& f0, double v_h) {
  const double grazing = std::pow(std::clamp(1.0 - v_h, 0.0, 1.0), 5.0);
  return f0 + (Eigen::Vector3d::Ones() - f0) * grazing;
}

}  // namespace sateen
