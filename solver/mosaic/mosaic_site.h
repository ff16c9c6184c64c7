#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "solver/lambertian.h"
#include "solver/lobe/lobe.h"
#include "solver/mosaic/mosaic_feed.h"
#include "solver/solve_input.h"

namespace sateen {

// Solution of one site, in double.
struct SiteSolution {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();  // N; zero: no answer
  double residual = 0.0;
  double uncertainty_deg = 0.0;
  double albedo_uncertainty = 0.0;
  double misfit = 0.0;
  int samples = 0;
  Reason reason = Reason::kDark;
};

// Solves (1) to (4) of solver/mosaic/mosaic.h for one site by Eigen's JacobiSVD in double: the
// plain form that the kernel is tested against, and the solver of the sites that the kernel
// refuses. Borrows its arguments for the time of one solve.
class MosaicSite {
 public:
  MosaicSite(const MosaicInput& input, const LambertianOptions& options, bool weighted);

  // Solves one site. `readings`: of the K lit frames; `dark`: radiance of the dark frame there.
  [[nodiscard]] SiteSolution Solve(int column, int row, const std::vector<uint16_t>& readings,
                                   float dark);

  // Returns the usable readings of a site of the piece for rung 3; the one colour stands in all
  // four columns. `limit`: largest explained misfit, by the number of readings.
  [[nodiscard]] std::optional<LobeSamples> LobeSamplesAt(int column, int row,
                                                         const MosaicPiece& piece,
                                                         const Eigen::Vector3d& v,
                                                         const std::array<float, 256>& limit);

 private:
  // Returns 1 / variance of usable reading k, at the brightness that N predicts.
  [[nodiscard]] double WeightOf(Eigen::Index k, size_t site, const Eigen::Vector3d& n) const;
  void Gather(int column, int row, const std::vector<uint16_t>& readings, float dark,
              SiteSolution& solution);
  void Weigh(size_t site, SiteSolution& solution) const;

  MosaicInput input_;
  const LambertianOptions& options_;
  bool weighted_;
  bool needs_position_;
  // Usable readings.
  Eigen::MatrixX3d l_;
  Eigen::VectorXd i_;
  Eigen::VectorXd e_;
  std::vector<size_t> frames_;
};

// Variance of radiance i at a site, shot i + read_squared, with the part of the subtracted dark
// frames.
struct SiteNoise {
  double shot = 0.0;
  double read_squared = 0.0;
};
[[nodiscard]] SiteNoise NoiseAt(const MosaicStack& stack, size_t frame, size_t site);
// Returns the radiance above which a reading is not dark.
[[nodiscard]] float DarkThreshold(const MosaicFrame& frame, const LambertianOptions& options);
// Returns the smallest saturated reading.
[[nodiscard]] float ClipThreshold(const MosaicFrame& frame, const LambertianOptions& options);

}  // namespace sateen
