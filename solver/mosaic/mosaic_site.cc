#include "solver/mosaic/mosaic_site.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/linear_algebra.h"
#include "rig/projection.h"
#include "solver/least_squares/weighted.h"
#include "solver/noise.h"

namespace sateen {
namespace {

constexpr float kNeverSaturates = 65536.0F;

// Returns the radiance at which the last of the four sites saturates.
float FullScaleOf(const MosaicFrame& frame) {
  float most = 0.0F;
  for (size_t site = 0; site < 4; ++site) {
    most = std::max(most, frame.per_dn[site] * frame.saturated_dn + frame.at_zero[site]);
  }
  return most;
}

}  // namespace

float ClipThreshold(const MosaicFrame& frame, const LambertianOptions& options) {
  if (frame.saturated_dn >= kNeverSaturates) {
    return kNeverSaturates;
  }
  // The level is a fraction of the way from zero radiance to saturation.
  const float zero_dn = -frame.at_zero[0] / frame.per_dn[0];
  return zero_dn + static_cast<float>(options.clip_level) * (frame.saturated_dn - zero_dn);
}

float DarkThreshold(const MosaicFrame& frame, const LambertianOptions& options) {
  return frame.saturated_dn >= kNeverSaturates
             ? 0.0F
             : static_cast<float>(options.dark_level) * FullScaleOf(frame);
}

SiteNoise NoiseAt(const MosaicStack& stack, size_t frame, size_t site) {
  const auto radiance_of_dn = static_cast<double>(stack.lit[frame].per_dn[site]);
  SiteNoise noise{.shot = stack.lit[frame].gain_dn * radiance_of_dn,
                  .read_squared = std::pow(stack.lit[frame].read_dn * radiance_of_dn, 2.0)};
  for (size_t k = 0; k < stack.dark.size(); ++k) {
    const double read = stack.dark[k].read_dn * static_cast<double>(stack.dark[k].per_dn[site]);
    noise.read_squared += std::pow(static_cast<double>(stack.dark_weights[k]) * read, 2.0);
  }
  return noise;
}

MosaicSite::MosaicSite(const MosaicInput& input, const LambertianOptions& options, bool weighted)
    : input_(input),
      options_(options),
      weighted_(weighted),
      needs_position_(!AllDistant(input.rig.lights)),
      l_(static_cast<Eigen::Index>(input.stack.lit.size()), 3),
      i_(static_cast<Eigen::Index>(input.stack.lit.size())),
      e_(static_cast<Eigen::Index>(input.stack.lit.size())),
      frames_(input.stack.lit.size()) {}

void MosaicSite::Gather(int column, int row, const std::vector<uint16_t>& readings, float dark,
                        SiteSolution& solution) {
  const size_t site = static_cast<size_t>(row % 2 * 2 + column % 2);
  const std::optional<Eigen::Vector3d> x_mm =
      needs_position_
          ? TablePointOfPixel(*input_.rig.camera, column, row, input_.HeightAt(column, row))
          : Eigen::Vector3d::Zero();
  int unsaturated = 0;
  int saturated = 0;
  bool bright = false;
  double brightest = 0.0;
  for (size_t k = 0; x_mm && k < readings.size(); ++k) {
    const MosaicFrame& frame = input_.stack.lit[k];
    const auto reading = static_cast<float>(readings[k]);
    const float radiance = frame.per_dn[site] * reading + frame.at_zero[site] - dark;
    const bool is_saturated = reading >= ClipThreshold(frame, options_);
    bright = bright || is_saturated || radiance > DarkThreshold(frame, options_);
    if (is_saturated) {
      ++saturated;
      continue;
    }
    const Incident incident = IncidentAt(input_.rig.lights[k], *x_mm);
    const double e = incident.e_rgb[input_.stack.cfa[site]];
    if (!(e > 0.0)) {
      continue;  // behind the LED
    }
    l_.row(unsaturated) = incident.l.transpose();
    i_[unsaturated] = static_cast<double>(radiance) / e;
    e_[unsaturated] = e;
    frames_[static_cast<size_t>(unsaturated)] = k;
    brightest = std::max(brightest, i_[unsaturated]);
    ++unsaturated;
  }
  for (Eigen::Index k = 0; k < unsaturated; ++k) {
    if (i_[k] > options_.shadow_level * brightest) {
      const Eigen::Index to = solution.samples++;
      l_.row(to) = l_.row(k).eval();
      i_[to] = i_[k];
      e_[to] = e_[k];
      frames_[static_cast<size_t>(to)] = frames_[static_cast<size_t>(k)];
    }
  }
  solution.reason = !bright                 ? Reason::kDark
                    : solution.samples >= 3 ? Reason::kSolved
                    : saturated > 0         ? Reason::kSaturated
                                            : Reason::kTooFewSamples;
}

SiteSolution MosaicSite::Solve(int column, int row, const std::vector<uint16_t>& readings,
                               float dark) {
  SiteSolution solution;
  Gather(column, row, readings, dark, solution);
  if (solution.reason != Reason::kSolved) {
    return solution;
  }
  const auto l = l_.topRows(solution.samples);
  const auto i = i_.head(solution.samples);
  const SvdSolution svd = SolveBySvd(l, i);
  solution.n = svd.x;
  if (!(svd.condition <= options_.max_condition) || !solution.n.allFinite() ||
      solution.n.isZero(0.0)) {
    solution.reason = Reason::kIllConditioned;
    solution.n.setZero();
    return solution;
  }
  solution.residual = (i - l * solution.n).norm() / std::sqrt(solution.samples);
  if (weighted_) {
    Weigh(static_cast<size_t>(row % 2 * 2 + column % 2), solution);
  }
  return solution;
}

double MosaicSite::WeightOf(Eigen::Index k, size_t site, const Eigen::Vector3d& n) const {
  const SiteNoise noise = NoiseAt(input_.stack, frames_[static_cast<size_t>(k)], site);
  const double predicted = std::max(l_.row(k).dot(n), static_cast<double>(kLeastCosine) * n.norm());
  return e_[k] * e_[k] / (noise.shot * predicted * e_[k] + noise.read_squared);  // (2)
}

std::optional<LobeSamples> MosaicSite::LobeSamplesAt(int column, int row, const MosaicPiece& piece,
                                                     const Eigen::Vector3d& v,
                                                     const std::array<float, 256>& limit) {
  std::vector<uint16_t> readings(input_.stack.lit.size());
  const size_t at =
      static_cast<size_t>(row - piece.Begin()) * static_cast<size_t>(input_.stack.size_px.width) +
      static_cast<size_t>(column);
  for (size_t k = 0; k < readings.size(); ++k) {
    readings[k] = piece.Reading(k, at);
  }
  SiteSolution solution;
  Gather(column, row, readings, piece.Dark(at), solution);
  if (solution.reason != Reason::kSolved) {
    return std::nullopt;
  }
  const Eigen::MatrixX3d l = l_.topRows(solution.samples);
  const Eigen::VectorXd i = i_.head(solution.samples);
  const Eigen::Vector3d n = SolveNormalEquations(l, i);
  Eigen::VectorXd weights(solution.samples);
  for (Eigen::Index k = 0; k < solution.samples; ++k) {
    weights[k] = WeightOf(k, static_cast<size_t>(row % 2 * 2 + column % 2), n);
  }
  // Counts samples as the maps do: 255 stands for more.
  return LobeSamples(
      l, i.replicate<1, 4>(), weights, v,
      static_cast<double>(limit[static_cast<size_t>(std::min(solution.samples, 255))]));
}

void MosaicSite::Weigh(size_t site, SiteSolution& solution) const {
  const auto l = l_.topRows(solution.samples);
  Eigen::VectorXd root_weights(solution.samples);
  for (Eigen::Index k = 0; k < solution.samples; ++k) {
    root_weights[k] = std::sqrt(WeightOf(k, site, solution.n));
  }
  const Eigen::MatrixXd weighted = root_weights.asDiagonal() * l;
  const Eigen::VectorXd rhs = root_weights.cwiseProduct(i_.head(solution.samples));
  solution.n = SolveBySvd(weighted, rhs).x;  // (3)
  if (solution.samples > 3) {
    solution.misfit = (rhs - weighted * solution.n).squaredNorm() / (solution.samples - 3);
  }
  const Eigen::Matrix3d c = (weighted.transpose() * weighted).inverse();
  const NormalVariances variances = VariancesOf(c, solution.n);
  solution.uncertainty_deg = std::sqrt(variances.angular) * kDegPerRad;
  solution.albedo_uncertainty = std::sqrt(variances.albedo);
}

}  // namespace sateen
