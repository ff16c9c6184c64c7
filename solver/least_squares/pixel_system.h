#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

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
  // Count() x 3: e_kr, e_kg, e_kb.
  [[nodiscard]] auto E() const { return e_.topRows(count_); }
  // Which frame a usable sample is of.
  [[nodiscard]] int FrameOf(Eigen::Index sample) const {
    return frames_[static_cast<size_t>(sample)];
  }
  [[nodiscard]] double ShadowLevel() const { return options_.shadow_level; }

 private:
  std::optional<Eigen::Vector3d> TablePoint(int column, int row) const;

  const LightStack& stack_;
  const Rig& rig_;
  const LambertianOptions& options_;
  bool needs_position_ = false;
  Eigen::MatrixXd l_;
  Eigen::MatrixXd rhs_;
  Eigen::MatrixX3d e_;
  std::vector<int> frames_;
  int count_ = 0;
  int saturated_ = 0;
  bool bright_ = false;
};

// Thresholds of one frame in radiance, shared by all backends so that they agree to the bit.
[[nodiscard]] float ClipThreshold(const LightFrame& frame, const LambertianOptions& options);
[[nodiscard]] float DarkThreshold(const LightFrame& frame, const LambertianOptions& options);

}  // namespace sateen
