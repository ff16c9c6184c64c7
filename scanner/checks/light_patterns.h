#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "rig/rig.h"

namespace sateen {

using BlockField = std::vector<double>;  // one value per block of a frame

// Returns e l of a light where a pixel sees the table, summed over colours; zero where the pixel
// does not see it. Where the camera has no pose, it is taken at the table's origin.
[[nodiscard]] Eigen::Vector3d LightAtPixel(const Rig& rig, const Light& light,
                                           const Eigen::Vector2d& px);

/// Tells by how brightness is spread over the picture which light lit a frame:
///
///     q_kb = log s_kb - med_j log s_jb,   r_kb = log E_kb - med_j log E_jb                    (1)
///     misfit_kj = var_b (q_kb - r_jb)                                                         (2)
///
/// where s_kb is block b of light k's frame and E_kb the brightness that the rig says. The median
/// over lights in (1) takes the texture of a fabric out. It runs over the lights that are on, so
/// that lights that have changed places do not disturb it.
class LightPatterns {
 public:
  // signal, predicted  s and E, [light][block]
  // on                 the lights of which one alone was on
  LightPatterns(const std::vector<BlockField>& signal, std::vector<BlockField> predicted,
                const std::vector<bool>& on);

  // Misfit (2) of a frame at its own light, and at the light where it is least.
  struct Fit {
    double own = 0.0;
    double least = 0.0;
    std::size_t best = 0;
  };
  [[nodiscard]] Fit FitOf(std::size_t k) const;

  // Returns the light that explains the frame of light k best where both are on.
  [[nodiscard]] std::optional<std::size_t> SecondLight(std::size_t k) const;

 private:
  std::vector<BlockField> predicted_;  // E
  BlockField median_predicted_;        // med_j log E_jb
  std::vector<BlockField> frames_;     // q
  std::vector<BlockField> lights_;     // r
};

}  // namespace sateen
