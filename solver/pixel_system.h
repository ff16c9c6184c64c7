#pragma once

#include <Eigen/Core>
#include <optional>

#include "imaging/light_stack.h"
#include "rig/rig.h"
#include "solver/lambertian.h"

namespace sateen {

// Equation (3) of solver/lambertian.h for one pixel, in double: the usable samples, or the reason
// why there are too few. The plain form that the fast kernel is tested against.
class PixelSystem {
 public:
  PixelSystem(const LightStack& stack, const Rig& rig, const LambertianOptions& options);

  // Gathers the usable samples of pixel (column, row).
  void Gather(int column, int row);

  // kSolved when there are at least three usable samples; otherwise why not.
  [[nodiscard]] Reason SampleReason() const;
  [[nodiscard]] int Count() const { return count_; }
  // Count() x 3: the l_k of the usable samples.
  [[nodiscard]] auto L() const { return l_.topRows(count_); }
  // Count() x 4: i'_kr, i'_kg, i'_kb, i'_k.
  [[nodiscard]] auto Rhs() const { return rhs_.topRows(count_); }

 private:
  std::optional<Eigen::Vector3d> TablePoint(int column, int row) const;

  const LightStack& stack_;
  const Rig& rig_;
  const LambertianOptions& options_;
  bool needs_position_ = false;
  Eigen::MatrixXd l_;
  Eigen::MatrixXd rhs_;
  int count_ = 0;
  int saturated_ = 0;
  bool bright_ = false;
};

// Thresholds of one frame in radiance, shared by all backends so that they agree to the bit.
[[nodiscard]] float ClipThreshold(const LightFrame& frame, const LambertianOptions& options);
[[nodiscard]] float DarkThreshold(const LightFrame& frame, const LambertianOptions& options);

}  // namespace sateen
