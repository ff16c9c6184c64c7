#pragma once

#include <array>
#include <optional>
#include <vector>

#include "rig/rig.h"
#include "solver/lambertian.h"

namespace sateen {

/// What errors of the lights' calibration do to a normal. A light that is off by the angle delta, with an
/// irradiance off by the share epsilon, moves the solution of N . l_k = i'_k, k = 1 .. K, by
///
///     dN = -sum_k g_k (delta_k . N + epsilon_k i'_k),   (g_1 .. g_K) = pseudo-inverse of (l_k^T)   (1)
///
/// With independent errors of the standard deviations that the rig has, s a light's position, d its distance,
///
///     sd(delta)^2 = (|sd(s)|^2 - |sd(s) l|^2) / 2 d^2, or half of the square of that of the direction,
///     sd(epsilon) = that of the irradiance                                                     (2)
///     angle^2 = tr Q - n.Q n,  (d rho / rho)^2 = n.Q n,
///     Q = sum_k g_k g_k^T (sd(delta)^2 (1 - c_k^2) + sd(epsilon)^2 c_k^2)   (3)
///
/// c_k = z . l_k stands for n . l_k, so that Q is one of the place alone; it is found in the middle of each
/// tile of 64 x 64 pixels. Right to 6 % where the cloth lies flat and no light is in shadow; on slopes of 30
/// degrees 11 to 15 % too small for directions and positions, 8 % too large for irradiances.
class LightDoubt {
 public:
  // Nothing where no light of the rig has a standard deviation. The rig has been checked against the size.
  [[nodiscard]] static std::optional<LightDoubt> Make(const Rig& rig, ImageSize size);

  // Adds (3) to both uncertainties of the solved pixels of a row of the image, the first of which has the
  // index `first` in the field.
  void AddToRow(int row, size_t first, NormalField& field) const;

 private:
  using Matrix = std::array<float, 6>;  // xx, yy, zz, xy, xz, yz of Q

  int columns_ = 0;  // of tiles
  std::vector<Matrix> tiles_;
};

}  // namespace sateen
