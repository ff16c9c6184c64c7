#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "imaging/mosaic_stack.h"
#include "rig/rig.h"
#include "solver/lambertian.h"
#include "solver/lobe/lobe.h"
#include "solver/mosaic/mosaic_feed.h"

namespace sateen {

// What a site's readings are worth, in double; zero N: no answer.
struct SiteSolution {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();  // N
  double residual = 0.0;
  double uncertainty_deg = 0.0;
  double albedo_uncertainty = 0.0;
  double misfit = 0.0;
  int samples = 0;
  Reason reason = Reason::kDark;
};

// Equations (1) to (4) of solver/mosaic/mosaic.h for one site by Eigen's JacobiSVD in double, as they stand
// there: what the kernel is tested against, and what solves the sites that it refuses.
class MosaicSite {
 public:
  MosaicSite(const MosaicStack& stack, const Rig& rig, const LambertianOptions& options,
             bool weighted);

  // `readings`: of the K lit frames; `dark`: radiance of the dark frame there.
  [[nodiscard]] SiteSolution Solve(int column, int row, const std::vector<uint16_t>& readings,
                                   float dark);

  // The usable readings of a site of the piece, for rung 3: of one colour, four times the same. `limit` of
  // the misfit, by how many they are.
  [[nodiscard]] std::optional<LobeSamples> LobeSamplesAt(int column, int row,
                                                         const MosaicPiece& piece,
                                                         const Eigen::Vector3d& v,
                                                         const std::array<float, 256>& limit);

 private:
  // 1 / variance of usable reading k, at what N predicts.
  [[nodiscard]] double WeightOf(Eigen::Index k, size_t site, const Eigen::Vector3d& n) const;
  void Gather(int column, int row, const std::vector<uint16_t>& readings, float dark,
              SiteSolution& solution);
  void Weigh(size_t site, SiteSolution& solution) const;

  const MosaicStack& stack_;
  const Rig& rig_;
  const LambertianOptions& options_;
  bool weighted_;
  bool needs_position_;
  // Usable readings.
  Eigen::MatrixX3d l_;
  Eigen::VectorXd i_;
  Eigen::VectorXd e_;
  std::vector<size_t> frames_;
};

// Variance of radiance i at a site: shot i + read_squared, the subtracted dark frames' part with it.
struct SiteNoise {
  double shot = 0.0;
  double read_squared = 0.0;
};
[[nodiscard]] SiteNoise NoiseAt(const MosaicStack& stack, size_t frame, size_t site);
// Radiance above which a reading is not dark.
[[nodiscard]] float DarkThreshold(const MosaicFrame& frame, const LambertianOptions& options);
// Reading from which on it is saturated.
[[nodiscard]] float ClipThreshold(const MosaicFrame& frame, const LambertianOptions& options);

}  // namespace sateen
