#include "pipelines/calibrate/predicted_errors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "calibration/lights/light_fit.h"
#include "core/angle.h"
#include "core/parallel.h"
#include "pipelines/calibrate/synthetic_sheets.h"
#include "rig/projection.h"
#include "simulation/random.h"

namespace sateen {
namespace {

// Draws for one rig, one after the other.
class Dice {
 public:
  explicit Dice(uint64_t seed) : seed_(seed) {}
  double Between(double low, double high) {
    return std::lerp(low, high, UniformDeviate(seed_, counter_++));
  }
  Eigen::Vector3d Direction() {
    const double x = NormalDeviate(seed_, counter_++);
    const double y = NormalDeviate(seed_, counter_++);
    return Eigen::Vector3d(x, y, NormalDeviate(seed_, counter_++)).normalized();
  }

 private:
  uint64_t seed_;
  uint64_t counter_ = 0;
};

// Unit vector `polar_rad` from the zenith.
Eigen::Vector3d FromZenith(double polar_rad, double azimuth_rad) {
  return {std::sin(polar_rad) * std::cos(azimuth_rad), std::sin(polar_rad) * std::sin(azimuth_rad),
          std::cos(polar_rad)};
}

SyntheticCamera RandomCamera(Dice& dice, const PredictedErrorOptions& options) {
  const int width = static_cast<int>(640.0 * std::exp2(dice.Between(0.0, 3.0)));
  return {.camera = OverheadCamera({width, width * 2 / 3}, dice.Between(500.0, 800.0),
                                   dice.Between(200.0, 350.0)),
          .columns = options.columns,
          .rows = options.rows,
          .full_well_electrons = dice.Between(15000.0, 60000.0)};
}

// Squares of actual over predicted.
struct Squares {
  Eigen::Vector3d position;
  Eigen::Vector3d flux;
  double direction = 0.0;
};

Squares Compare(const LightFit& fit, const Light& truth, const std::vector<SheetSample>& samples) {
  Squares squares;
  squares.position =
      (fit.light.position_mm - truth.position_mm).cwiseQuotient(fit.position_sd_mm).cwiseAbs2();
  squares.flux = (fit.light.flux_rgb.cwiseQuotient(truth.flux_rgb) - Eigen::Vector3d::Ones())
                     .cwiseQuotient(fit.flux_sd)
                     .cwiseAbs2();
  double worst = 0.0;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector3d a = fit.light.position_mm - sample.point_mm;
    const Eigen::Vector3d b = truth.position_mm - sample.point_mm;
    worst = std::max(worst, AngleBetweenRad(a, b));
  }
  squares.direction = std::pow(worst / fit.direction_sd_rad, 2);
  return squares;
}

Result<Squares> TryRig(const PredictedErrorOptions& options, uint64_t rig) {
  const uint64_t seed = HashOf(options.seed, rig);
  Dice dice(seed);
  const SyntheticCamera camera = RandomCamera(dice, options);
  const double full_turn = 2.0 * std::numbers::pi;
  Light truth{.name = "led", .model = LightModel::kNear};
  truth.position_mm = dice.Between(450.0, 750.0) * FromZenith(dice.Between(25.0, 60.0) * kRadPerDeg,
                                                              dice.Between(0.0, full_turn));
  // Half to nine tenths of full scale in the middle of the sheet.
  const double falloff = truth.position_mm.z() / std::pow(truth.position_mm.norm(), 3) * 1e6;
  const double red = dice.Between(0.5, 0.9);
  const double green = dice.Between(0.5, 0.9);
  truth.flux_rgb = Eigen::Vector3d(red, green, dice.Between(0.5, 0.9)) / falloff;
  std::vector<Eigen::Vector3d> normals = {Eigen::Vector3d::UnitZ()};
  for (int tilt = 0; tilt < options.tilts; ++tilt) {
    normals.push_back(
        FromZenith(dice.Between(5.0, 15.0) * kRadPerDeg,
                   full_turn * (tilt + dice.Between(-0.2, 0.2)) / std::max(options.tilts, 1)));
  }
  Light rough = truth;
  rough.position_mm += options.off_mm * dice.Direction();
  rough.flux_rgb.setOnes();
  const std::vector<SheetSample> samples = SamplesOn(normals, camera, truth, HashOf(seed, 1));
  return FitLight(samples, rough, {.albedo = camera.albedo}).map([&](const LightFit& fit) {
    return Compare(fit, truth, samples);
  });
}

}  // namespace

Status PredictedErrorOptions::Validate() const {
  if (rigs < 10 || columns < 8 || rows < 8 || tilts < 0 || !(off_mm >= 0.0 && off_mm <= 50.0)) {
    return Fail(
        ErrorCode::kInvalidArgument,
        "rigs = {}, columns = {}, rows = {}, tilts = {}, off_mm = {:g}; need 10, 8, 8, 0 at "
        "least, and off_mm of 0 to 50",
        rigs, columns, rows, tilts, off_mm);
  }
  return {};
}

Result<ErrorRatios> PredictedErrors(const PredictedErrorOptions& options, const Task& task) {
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  std::vector<Result<Squares>> squares(static_cast<size_t>(options.rigs));
  if (Status ran = ParallelFor(options.rigs, 1, task,
                               [&](int begin, int end) {
                                 for (int rig = begin; rig < end; ++rig) {
                                   squares[static_cast<size_t>(rig)] =
                                       TryRig(options, static_cast<uint64_t>(rig));
                                 }
                               });
      !ran) {
    return tl::unexpected(ran.error());
  }
  ErrorRatios ratios{.rigs = options.rigs};
  for (const Result<Squares>& one : squares) {
    if (!one) {
      return tl::unexpected(one.error());
    }
    ratios.position += one->position / options.rigs;
    ratios.flux += one->flux / options.rigs;
    ratios.direction += one->direction / options.rigs;
  }
  ratios.position = ratios.position.cwiseSqrt();
  ratios.flux = ratios.flux.cwiseSqrt();
  ratios.direction = std::sqrt(ratios.direction);
  return ratios;
}

}  // namespace sateen
