// Standard deviations that calibration returns, against the errors that they are of.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "calibration/lens/pose.h"
#include "calibration/lights/field_fit.h"
#include "calibration/lights/light_fit.h"
#include "calibration/lights/light_residuals.h"
#include "calibration/response/photon_transfer.h"
#include "calibration/response/white_balance.h"
#include "calibration/sheet/sheet_sample.h"
#include "calibration/spheres/spheres.h"
#include "core/angle.h"
#include "simulation/random.h"
#include "simulation/rigs.h"
#include "tests/calibration/actual_over_predicted.h"
#include "tests/calibration/synthetic_boards.h"
#include "tests/calibration/synthetic_sheets.h"

namespace sateen::standard_deviations_test {
namespace {

using sateen::testing::ActualOverPredicted;
using sateen::testing::CameraFromBoard;
using sateen::testing::LensOf3000Px;
using sateen::testing::SamplesOf;
using sateen::testing::SeenBoard;
using sateen::testing::SyntheticCamera;

using Vector6d = Eigen::Matrix<double, 6, 1>;

SyntheticCamera CoarseCamera() {
  return {.camera = OverheadCamera({4928, 3264}, 610.0, 300.0), .columns = 12, .rows = 8};
}

Light TrueLight(LightModel model) {
  Light light = LedRing(model, 10, 45.0 * kRadPerDeg, 600.0)[3];
  light.flux_rgb = {0.40, 0.36, 0.30};
  return light;
}

std::vector<size_t> AllOf(const std::vector<SheetSample>& samples) {
  std::vector<size_t> indices(samples.size());
  std::iota(indices.begin(), indices.end(), size_t{0});
  return indices;
}

// Errors of position and log flux.
Vector6d LightErrors(const Light& fit, const Light& truth) {
  Vector6d errors;
  errors << fit.position_mm - truth.position_mm,
      fit.flux_rgb.cwiseQuotient(truth.flux_rgb).array().log().matrix();
  return errors;
}

TEST(StandardDeviations, OfALightsPositionFluxAndIrradiance) {
  const Light truth = TrueLight(LightModel::kNear);
  Light rough = truth;
  rough.position_mm += Eigen::Vector3d(3.0, -2.0, 4.0);
  ActualOverPredicted position;
  ActualOverPredicted flux;
  ActualOverPredicted irradiance;
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const LightFit fit = FitLight(SamplesOf(CoarseCamera(), truth, 5, 100 + seed), rough,
                                  {.highest_rung = LightModel::kNear})
                             .value();
    const Vector6d errors = LightErrors(fit.light, truth);
    for (Eigen::Index i = 0; i < 3; ++i) {
      position.Add(errors[i], fit.position_sd_mm[i]);
      flux.Add(errors[3 + i], fit.flux_sd[i]);
    }
    // The irradiance is that of the samples' middle.
    const Eigen::Vector3d ratio =
        IncidentAt(fit.light, {0.0, 0.0, 0.0})
            .e_rgb.cwiseQuotient(IncidentAt(truth, {0.0, 0.0, 0.0}).e_rgb);
    irradiance.Add(std::sqrt((ratio.array() - 1.0).square().mean()),
                   fit.light.irradiance_sd.value());
  }
  fmt::print("errors over standard deviations: position {:.3f}, flux {:.3f}, irradiance {:.3f}\n",
             position.Ratio(), flux.Ratio(), irradiance.Ratio());
  EXPECT_NEAR(position.Ratio(), 1.0, 0.1);
  EXPECT_NEAR(flux.Ratio(), 1.0, 0.1);
  EXPECT_NEAR(irradiance.Ratio(), 1.0, 0.1);
}

TEST(StandardDeviations, OfALightWithAGainField) {
  const Light truth = TrueLight(LightModel::kLed);
  Light ruler = truth;
  ruler.position_mm += Eigen::Vector3d(0.5, -0.5, 0.5);
  ActualOverPredicted all;
  ActualOverPredicted flux;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const std::vector<SheetSample> samples = SamplesOf(CoarseCamera(), truth, 5, 300 + seed);
    const FieldFit fit =
        FitField(samples, ruler, AllOf(samples), {}, 1e-3, {.spacing_mm = 100.0}).value();
    const Vector6d errors = LightErrors(fit.light, truth);
    all.Add(errors, fit.covariance);
    for (Eigen::Index i = 3; i < 6; ++i) {
      flux.Add(errors[i], std::sqrt(fit.covariance(i, i)));
    }
  }
  fmt::print("errors over standard deviations: position and flux {:.3f}, flux {:.3f}\n",
             all.Ratio(), flux.Ratio());
  EXPECT_NEAR(all.Ratio(), 1.0, 0.1);
  EXPECT_NEAR(flux.Ratio(), 1.0, 0.15);
}

// One flat sheet and a gain that may be anything say little of where the light is: the prior stays,
// with its standard deviation.
TEST(StandardDeviations, OfALightThatTheSheetCannotPlaceAreTheRulers) {
  const Light truth = TrueLight(LightModel::kLed);
  Light ruler = truth;
  ruler.position_mm += Eigen::Vector3d(4.0, -3.0, 5.0);
  SyntheticCamera camera = CoarseCamera();
  camera.columns *= 2;
  camera.rows *= 2;
  const std::vector<SheetSample> samples = SamplesOf(camera, truth, 1, 400);
  for (const double sd_mm : {1.0, 2.0}) {
    const FieldFit fit = FitField(samples, ruler, AllOf(samples), {}, 1e-9,
                                  {.spacing_mm = 60.0, .gain_sd = 100.0, .position_sd_mm = sd_mm})
                             .value();
    const double noise = LightResiduals(samples, 0.99).NoiseRms(fit.light, fit.used);
    EXPECT_LT((fit.light.position_mm - ruler.position_mm).norm(), 0.3 * sd_mm);
    for (Eigen::Index i = 0; i < 3; ++i) {
      EXPECT_NEAR(noise * std::sqrt(fit.covariance(i, i)), sd_mm, 0.02 * sd_mm) << i;
    }
  }
}

// Across the line of sight a position is known to s mm, and the direction to s over the distance.
TEST(StandardDeviations, OfADirectionAreThoseAcrossIt) {
  const std::vector<SheetSample> samples = {{.point_mm = {0.0, 0.0, 0.0}},
                                            {.point_mm = {0.0, 0.0, -200.0}}};
  const Eigen::Vector3d position_mm(0.0, 0.0, 400.0);
  const Eigen::Matrix3d covariance = Eigen::Vector3d(4.0, 9.0, 100.0).asDiagonal();
  EXPECT_NEAR(WorstDirectionSd(samples, position_mm, covariance), 3.0 / 400.0, 1e-12);
  EXPECT_NEAR(WorstDirectionSd({samples[1]}, position_mm, covariance), 3.0 / 600.0, 1e-12);
}

// Rays from `count` spheres that are off by `sd` about each of two axes.
std::vector<SphereRay> NoisyRays(const Eigen::Vector3d& lamp, int count, double sd, uint64_t seed) {
  std::vector<SphereRay> rays;
  for (int j = 0; j < count; ++j) {
    const auto counter = static_cast<uint64_t>(2 * j);
    const Eigen::Vector3d from(80.0 * (j % 3 - 1), 70.0 * (j / 3 - 1), 20.0);
    const Eigen::Vector3d l = (lamp - from).normalized();
    const Eigen::Vector3d a = l.unitOrthogonal();
    const Eigen::Vector3d off = NormalDeviate(seed, counter) * a +
                                NormalDeviate(seed, counter + 1) * Eigen::Vector3d(l.cross(a));
    rays.push_back({from, (l + sd * off).normalized()});
  }
  return rays;
}

struct Squares {
  Eigen::Vector3d actual = Eigen::Vector3d::Zero();
  Eigen::Vector3d predicted = Eigen::Vector3d::Zero();

  [[nodiscard]] double Ratio() const { return std::sqrt(actual.sum() / predicted.sum()); }
};

// Few rays know their own scatter badly, so sums are compared.
Squares SphereSquares(double noise_rad, double ray_sd_rad) {
  const Eigen::Vector3d lamp(150.0, -100.0, 450.0);
  Squares squares;
  for (uint64_t seed = 0; seed < 2000; ++seed) {
    const SphereLight light = LightFromRays(NoisyRays(lamp, 9, noise_rad, seed), true, "frame",
                                            {.ray_sd_rad = ray_sd_rad})
                                  .value();
    squares.actual += (light.light.position_mm - lamp).cwiseAbs2();
    squares.predicted += light.position_sd_mm.value().cwiseAbs2();
  }
  return squares;
}

TEST(StandardDeviations, OfALampBetweenSpheres) {
  const double from_scatter = SphereSquares(0.004, 1e-6).Ratio();
  // Angles of both axes are counted together, so that a ray of 0.002 is off by 0.002 about each.
  const double from_option = SphereSquares(0.0004, 0.002).Ratio();
  fmt::print("errors over standard deviations: rays {:.3f}, better rays than said {:.3f}\n",
             from_scatter, from_option);
  EXPECT_NEAR(from_scatter, 1.0, 0.04);
  EXPECT_NEAR(from_option, 0.2, 0.01);
}

TEST(StandardDeviations, OfADirectionFromOneSphere) {
  const SphereLight one =
      LightFromRays(NoisyRays({0.0, 0.0, 500.0}, 1, 0.0, 1), true, "f", {.ray_sd_rad = 0.003})
          .value();
  EXPECT_NEAR(one.light.direction_sd_deg.value(), 0.003 * kDegPerRad, 1e-12);
  EXPECT_FALSE(one.position_sd_mm);
}

TEST(StandardDeviations, OfACamerasPose) {
  const Camera lens = LensOf3000Px();
  const BoardSpec board = ParseBoardSpec("charuco:10x7:20mm:15mm").value();
  ActualOverPredicted each;
  ActualOverPredicted together;
  for (uint64_t run = 0; run < 150; ++run) {
    const auto at = static_cast<double>(run);
    const Eigen::Isometry3d pose =
        CameraFromBoard(17.0 * at, 10.0 + 0.1 * at, 40.0 * at, {20, -10, 600});
    const PoseFit truth = FitPose(lens, SeenBoard(lens, board, pose, 0.0, 1)).value();
    const PoseFit fit = FitPose(lens, SeenBoard(lens, board, pose, 0.1, 500 + run)).value();
    const Eigen::AngleAxisd turn(fit.table_from_camera.linear() *
                                 truth.table_from_camera.linear().transpose());
    Vector6d errors;
    errors << turn.angle() * turn.axis(),
        fit.table_from_camera.translation() - truth.table_from_camera.translation();
    // A turn about z is tied to the others, so the covariance has a rank of 5. Rotation and
    // position are compared alone, and added as they move the place on the table that the camera
    // sees.
    for (Eigen::Index i = 0; i < 6; ++i) {
      each.Add(errors[i], std::sqrt(fit.covariance(i, i)));
    }
    for (const double sign : {1.0, -1.0}) {
      for (const auto& [rotation, position] : {std::pair{0, 4}, {1, 3}}) {
        Vector6d sum = Vector6d::Zero();
        sum[rotation] = 600.0;
        sum[position] = sign;
        together.Add(sum.dot(errors), std::sqrt(sum.dot(fit.covariance * sum)));
      }
    }
    EXPECT_TRUE(fit.rotation_sd_rad.isApprox(fit.covariance.diagonal().head<3>().cwiseSqrt()));
    EXPECT_TRUE(fit.position_sd_mm.isApprox(fit.covariance.diagonal().tail<3>().cwiseSqrt()));
  }
  fmt::print("errors over standard deviations: pose {:.3f}, its sums {:.3f}\n", each.Ratio(),
             together.Ratio());
  EXPECT_NEAR(each.Ratio(), 1.0, 0.1);
  EXPECT_NEAR(together.Ratio(), 1.0, 0.1);
}

// Variances of pairs of frames as a sensor of gain 0.5 and read noise 2 DN has them.
std::vector<TransferPoint> NoisyPoints(uint64_t seed) {
  constexpr double kCount = 400.0;
  std::vector<TransferPoint> points;
  uint64_t counter = 0;
  for (const double mean_dn : {0.0, 0.0, 100.0, 300.0, 1000.0, 3000.0}) {
    for (size_t c = 0; c < 3; ++c) {
      const double variance = 0.5 * mean_dn + 4.0 + 1.0 / 12.0;
      const double off = std::sqrt(2.0 / (kCount - 1.0)) * NormalDeviate(seed, counter++);
      points.push_back({mean_dn, variance * (1.0 + off), kCount, c, mean_dn == 0.0});
    }
  }
  return points;
}

TEST(StandardDeviations, OfGainAndReadNoise) {
  for (const bool use_dark : {true, false}) {
    ActualOverPredicted gain;
    ActualOverPredicted gain_rgb;
    ActualOverPredicted read_noise;
    for (uint64_t seed = 0; seed < 1000; ++seed) {
      const PhotonTransfer transfer = FitPhotonTransfer(NoisyPoints(seed), use_dark).value();
      gain.Add(transfer.gain_dn_per_electron - 0.5, transfer.gain_sd);
      for (size_t c = 0; c < 3; ++c) {
        gain_rgb.Add(transfer.gain_rgb[c] - 0.5, transfer.gain_rgb_sd[c]);
      }
      if (use_dark) {  // lit points alone leave it known to half of itself
        read_noise.Add(transfer.read_noise_dn - 2.0, transfer.read_noise_sd);
      }
    }
    fmt::print("errors over standard deviations: gain {:.3f}, of colours {:.3f}\n", gain.Ratio(),
               gain_rgb.Ratio());
    EXPECT_NEAR(gain.Ratio(), 1.0, 0.06);
    EXPECT_NEAR(gain_rgb.Ratio(), 1.0, 0.06);
    if (use_dark) {
      EXPECT_NEAR(read_noise.Ratio(), 1.0, 0.06);
    }
  }
}

// One patch in four frames of its own noise.
TEST(StandardDeviations, OfAWhiteBalance) {
  ActualOverPredicted ratio;
  for (uint64_t seed = 0; seed < 1000; ++seed) {
    std::vector<PatchSample> samples;
    uint64_t counter = 0;
    for (size_t frame = 0; frame < 4; ++frame) {
      for (size_t c = 0; c < 3; ++c) {
        const double truth_dn = std::array{500.0, 1000.0, 800.0}[c];
        const double sd_dn = truth_dn * 0.002 * static_cast<double>(frame + c + 1);
        samples.push_back({.frame = frame,
                           .colour = c,
                           .signal_dn = truth_dn + sd_dn * NormalDeviate(seed, counter++),
                           .sd_dn = sd_dn});
      }
    }
    const LightBalance balance = *BalanceLights(samples, {{0.5, 0.5, 0.5}}, 1)[0];
    ratio.Add(balance.white_balance[0] - 2.0, balance.sd[0]);
    ratio.Add(balance.white_balance[2] - 1.25, balance.sd[2]);
  }
  fmt::print("errors over standard deviations: white balance {:.3f}\n", ratio.Ratio());
  EXPECT_NEAR(ratio.Ratio(), 1.0, 0.06);
}

// Means of 40 sites with a noise of 20 DN, above a dark frame without any.
TEST(StandardDeviations, OfAPatchsMean) {
  ChartReadings readings{.lights = {"led"}, .patch_names = {"p"}};
  readings.reflectance_rgb = {Eigen::Vector3d::Ones()};
  constexpr size_t kSites = 120;
  PatchSites& sites = readings.patches.emplace_back();
  for (size_t i = 0; i < kSites; ++i) {
    sites.colour.push_back(static_cast<uint8_t>(i % 3));
    sites.block.push_back(0);
  }
  readings.frames = {
      {.file = "dark", .exposure_s = 1.0, .dn = {std::vector<uint16_t>(kSites, 100)}}};
  for (uint64_t seed = 0; seed < 500; ++seed) {
    std::vector<uint16_t> dn;
    for (size_t i = 0; i < kSites; ++i) {
      dn.push_back(static_cast<uint16_t>(std::lround(1100.0 + 20.0 * NormalDeviate(seed, i))));
    }
    readings.frames.push_back({.file = "f", .light = 0, .exposure_s = 1.0, .dn = {dn}});
  }
  DarkLevel dark;
  ActualOverPredicted ratio;
  for (const PatchSample& sample : SamplesOf(readings, dark)) {
    ratio.Add(sample.signal_dn - 1000.0, sample.sd_dn);
  }
  fmt::print("errors over standard deviations: mean of a patch {:.3f}\n", ratio.Ratio());
  EXPECT_NEAR(ratio.Ratio(), 1.0, 0.06);
}

}  // namespace
}  // namespace sateen::standard_deviations_test
