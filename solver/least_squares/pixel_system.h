#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "solver/lambertian.h"
#include "solver/solve_input.h"

namespace sateen {

// One pixel of equation (3) of solver/lambertian.h, in double: its usable samples, or the reason
// why there are too few. The plain form that the fast kernel is tested against.
class PixelSystem {
 public:
  PixelSystem(const FramesInput& input, const LambertianOptions& options);

  // Gathers the usable samples of pixel (column, row).
  void Gather(int column, int row);

  // Returns kSolved where at least three samples are usable, otherwise why they are not.
  [[nodiscard]] Reason SampleReason() const;
  [[nodiscard]] int Count() const { return count_; }
  // Count() x 3: the l_k of the usable samples.
  [[nodiscard]] auto L() const { return l_.topRows(count_); }
  // Count() x 4: i'_kr, i'_kg, i'_kb, i'_k.
  [[nodiscard]] auto Rhs() const { return rhs_.topRows(count_); }
  // Count() x 3: e_kr, e_kg, e_kb.
  [[nodiscard]] auto E() const { return e_.topRows(count_); }
  // Returns the frame of a usable sample.
  [[nodiscard]] int FrameOf(Eigen::Index sample) const {
    return frames_[static_cast<size_t>(sample)];
  }
  [[nodiscard]] double ShadowLevel() const { return options_.shadow_level; }

 private:
  std::optional<Eigen::Vector3d> TablePoint(int column, int row) const;

  FramesInput input_;
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

// Returns the weights of red, green and blue in a luminance.
[[nodiscard]] Eigen::Vector3d LuminanceWeights();

// Return the thresholds of one frame in radiance. All backends share them, so that they agree to
// the bit.
[[nodiscard]] float ClipThreshold(const LightFrame& frame, const LambertianOptions& options);
[[nodiscard]] float DarkThreshold(const LightFrame& frame, const LambertianOptions& options);

}  // namespace sateen
