#include "calibration/lights/seed_procedure.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "core/angle.h"
#include "core/gauss_newton.h"

namespace sateen {
namespace {

constexpr int kMostPositionSteps = 20;  // in (2)
constexpr double kLeastPositionStepMm = 1e-9;

using Map = std::vector<Eigen::Vector3d>;

// Smooths by (1 2 1) / 4 along one direction, where both neighbours are known. A linear map is not
// changed, not even at the border.
Map SmoothedAlong(const Map& map, int count, int stride, int lines, int line_stride) {
  Map smoothed = map;
  for (int line = 0; line < lines; ++line) {
    for (int i = 1; i + 1 < count; ++i) {
      const std::ptrdiff_t at = std::ptrdiff_t{line} * line_stride + std::ptrdiff_t{i} * stride;
      const auto value = [&](std::ptrdiff_t offset) -> const Eigen::Vector3d& {
        return map[static_cast<size_t>(at + offset)];
      };
      if (value(-stride).x() > 0.0 && value(0).x() > 0.0 && value(stride).x() > 0.0) {
        smoothed[static_cast<size_t>(at)] =
            0.25 * value(-stride) + 0.5 * value(0) + 0.25 * value(stride);
      }
    }
  }
  return smoothed;
}

class Procedure {
 public:
  Procedure(const std::vector<SheetSample>& samples, const std::vector<int>& blocks, int columns,
            int rows, const SeedProcedureOptions& options)
      : samples_(samples), blocks_(blocks), columns_(columns), rows_(rows), options_(options) {}

  // Returns (1).
  [[nodiscard]] Map IntensityMap(const Eigen::Vector3d& s) const {
    Map map(static_cast<size_t>(columns_) * static_cast<size_t>(rows_), Eigen::Vector3d::Zero());
    for (size_t i = 0; i < samples_.size(); ++i) {
      const SheetSample& sample = samples_[i];
      const double cosine = sample.normal.dot((s - sample.point_mm).normalized());
      if (cosine > 0.0) {
        map[static_cast<size_t>(blocks_[i])] = sample.radiance_rgb / (options_.albedo * cosine);
      }
    }
    for (int pass = 0; pass < options_.smoothing_passes; ++pass) {
      map = SmoothedAlong(map, columns_, 1, rows_, columns_);
      map = SmoothedAlong(map, rows_, columns_, columns_, 1);
    }
    return map;
  }

  // Solves (2) from position s. The result is not finite where there is no solution.
  [[nodiscard]] Eigen::Vector3d SolvePosition(const Map& intensity,
                                              const Eigen::Vector3d& s) const {
    Eigen::Vector4d start;
    start << s,
        options_.direction_step == DirectionStep::kFallOff ? MeanLogFlux(intensity, s) : 0.0;
    const auto fit = MinimizeSquares<4>(
        start, [&](const Eigen::Vector4d& x) { return PositionEquations(intensity, x); },
        [](const Eigen::Vector4d& x, const Eigen::Vector4d& step) {
          return Eigen::Vector4d(x + step);
        },
        {.rule = StepRule::kFull, .max_iterations = kMostPositionSteps, .min_relative_fall = 0.0},
        [](const Eigen::Vector4d& step) { return step.head<3>().norm() <= kLeastPositionStepMm; });
    return fit.end == GaussNewtonEnd::kNotFinite
               ? Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())
               : Eigen::Vector3d(fit.state.head<3>());
  }

  [[nodiscard]] double LargestTurn(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
    double turn = 0.0;
    for (const SheetSample& sample : samples_) {
      const Eigen::Vector3d a = from - sample.point_mm;
      const Eigen::Vector3d b = to - sample.point_mm;
      turn = std::max(turn, AngleBetweenRad(a, b));
    }
    return turn;
  }

 private:
  // Returns the normal equations of (3a) or (3b) for position and log phi.
  [[nodiscard]] NormalEquations<4> PositionEquations(const Map& intensity,
                                                     const Eigen::Vector4d& x) const {
    NormalEquations<4> equations;
    for (size_t i = 0; i < samples_.size(); ++i) {
      const double held = intensity[static_cast<size_t>(blocks_[i])].sum();
      if (held > 0.0) {
        AddSample(samples_[i], held, x, equations);
      }
    }
    if (options_.direction_step == DirectionStep::kEquation) {
      equations.information(3, 3) = 1.0;  // phi has no part in it
    }
    return equations;
  }

  void AddSample(const SheetSample& sample, double held, const Eigen::Vector4d& x,
                 NormalEquations<4>& equations) const {
    const Eigen::Vector3d d = x.head<3>() - sample.point_mm;
    const double distance = d.norm();
    Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
    double residual = 0.0;
    if (options_.direction_step == DirectionStep::kEquation) {
      const double measured = sample.radiance_rgb.sum();
      const Eigen::Vector3d l = d / distance;
      const double scale = options_.albedo * held / measured;
      const double cosine = sample.normal.dot(l);
      residual = 1.0 - scale * cosine;  // (3a)
      gradient.head<3>() = scale * (sample.normal - cosine * l) / distance;
    } else {
      residual = std::log(held) - x[3] + 2.0 * std::log(distance);  // (3b)
      gradient << -2.0 * d / (distance * distance), 1.0;
    }
    equations.Add(gradient, residual);
  }

  [[nodiscard]] double MeanLogFlux(const Map& intensity, const Eigen::Vector3d& s) const {
    double sum = 0.0;
    double count = 0.0;
    for (size_t i = 0; i < samples_.size(); ++i) {
      const double held = intensity[static_cast<size_t>(blocks_[i])].sum();
      if (held > 0.0) {
        sum += std::log(held) + 2.0 * std::log((s - samples_[i].point_mm).norm());
        count += 1.0;
      }
    }
    return sum / std::max(count, 1.0);
  }

  const std::vector<SheetSample>& samples_;
  const std::vector<int>& blocks_;
  int columns_;
  int rows_;
  const SeedProcedureOptions& options_;
};

}  // namespace

Status SeedProcedureOptions::Validate() const {
  if (!(albedo > 0.0 && albedo <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "albedo = {:g}; need 0 < albedo <= 1", albedo);
  }
  if (smoothing_passes < 0) {
    return Fail(ErrorCode::kInvalidArgument, "smoothing_passes = {}; need 0 or more",
                smoothing_passes);
  }
  if (most_rounds < 1) {
    return Fail(ErrorCode::kInvalidArgument, "most_rounds = {}; need 1 or more", most_rounds);
  }
  if (!(least_turn_rad > 0.0)) {
    return Fail(ErrorCode::kInvalidArgument, "least_turn_rad = {:g}; need a number > 0",
                least_turn_rad);
  }
  return {};
}

Incident IncidentAt(const SeedLight& light, int block, const Eigen::Vector3d& x_mm) {
  const auto at = static_cast<size_t>(block);
  const Eigen::Vector3d d = light.position_mm - x_mm;
  const double carried = (light.position_mm - light.point_mm[at]).squaredNorm() / d.squaredNorm();
  return {d.normalized(), light.intensity_rgb[at] * carried};
}

Eigen::Vector3d IntensityAtCentre(const std::vector<SheetSample>& samples,
                                  const Eigen::Vector3d& position_mm, double albedo) {
  const auto nearest = std::ranges::min_element(samples, {}, [](const SheetSample& sample) {
    return sample.point_mm.head<2>().squaredNorm();
  });
  if (nearest == samples.end()) {
    return Eigen::Vector3d::Zero();
  }
  const Eigen::Vector3d l = (position_mm - nearest->point_mm).normalized();
  return nearest->radiance_rgb / (albedo * nearest->normal.dot(l));
}

Result<SeedLight> CalibrateBySeedProcedure(const std::vector<SheetSample>& samples,
                                           const std::vector<int>& blocks, int columns, int rows,
                                           const Eigen::Vector3d& position_mm,
                                           const SeedProcedureOptions& options) {
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  if (samples.empty()) {
    return Fail(ErrorCode::kDegenerate, "no samples of the sheet; need some");
  }
  const Procedure procedure(samples, blocks, columns, rows, options);
  SeedLight light{.position_mm = position_mm};
  light.point_mm.resize(static_cast<size_t>(columns) * static_cast<size_t>(rows),
                        Eigen::Vector3d::Zero());
  for (size_t i = 0; i < samples.size(); ++i) {
    light.point_mm[static_cast<size_t>(blocks[i])] = samples[i].point_mm;
  }
  while (!light.converged && light.rounds < options.most_rounds) {
    light.intensity_rgb = procedure.IntensityMap(light.position_mm);  // (1)
    const Eigen::Vector3d moved =
        procedure.SolvePosition(light.intensity_rgb, light.position_mm);  // (2)
    if (!(moved.allFinite() && samples[0].normal.dot(moved - samples[0].point_mm) > 0.0)) {
      return Fail(ErrorCode::kDegenerate,
                  "round {} puts the light behind the sheet; start from a better position",
                  light.rounds + 1);
    }
    light.converged = procedure.LargestTurn(light.position_mm, moved) <= options.least_turn_rad;
    light.position_mm = moved;
    ++light.rounds;
  }
  light.intensity_rgb = procedure.IntensityMap(light.position_mm);
  return light;
}

}  // namespace sateen
