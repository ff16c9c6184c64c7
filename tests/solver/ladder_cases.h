#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/angle.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "solver/evaluate.h"
#include "solver/ladder.h"
#include "tests/solver/solver_cases.h"

// Stacks with known answers for the tests of the ladder.
namespace sateen::testing {

// Ten lights at two heights: samples of three of them are never in one plane with the camera.
inline Rig TwoRings() {
  Lights lights = DistantRing(5, 25.0 * kRadPerDeg);
  for (const Light& light : DistantRing(5, 50.0 * kRadPerDeg)) {
    lights.push_back(light);
  }
  for (size_t k = 5; k < lights.size(); ++k) {
    const Eigen::AngleAxisd turn(0.6, Eigen::Vector3d::UnitZ());
    lights[k].direction = turn * lights[k].direction;
    lights[k].name = fmt::format("outer-{}", k);
    lights[k].channel = static_cast<int>(k);
  }
  return DistantRig(std::move(lights));
}

inline LadderOptions Forced(LadderMode mode, Backend backend = Backend::kAuto) {
  return {.mode = mode, .least_squares = {.backend = backend}};
}

inline NormalField MustSolve(const LightStack& stack, const Rig& rig,
                             const LadderOptions& options = {}, int threads = 0) {
  return SolveLadder(stack, rig, std::nullopt, options, {.threads = threads}).value();
}

inline ErrorStatistics ErrorOf(const NormalField& field, const RenderedRelief& truth) {
  return AngularErrorDeg(field, truth.normal).value();
}

// Multiplies `spoiled` samples of every pixel, other ones from pixel to pixel: highlights and
// shadows of all sizes.
inline void Spoil(LightStack& stack, int spoiled, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<size_t> lights(stack.size());
  for (size_t k = 0; k < lights.size(); ++k) {
    lights[k] = k;
  }
  std::uniform_real_distribution<double> shadow(0.5, 0.8);
  std::uniform_real_distribution<double> highlight(1.5, 20.0);
  for (size_t p = 0; p < stack[0].rgb[0].pixels.size(); ++p) {
    std::shuffle(lights.begin(), lights.end(), random);
    for (int j = 0; j < spoiled; ++j) {
      const auto factor = static_cast<float>(j % 3 == 2 ? shadow(random) : highlight(random));
      for (Image<float>& plane : stack[lights[static_cast<size_t>(j)]].rgb.planes) {
        plane.pixels[p] *= factor;
      }
    }
  }
}

// The noise of RenderRelief's sensor.
inline StackNoise NoiseOfSensor(const SensorModel& sensor, size_t frames) {
  SampleNoise noise;
  const double unit = sensor.full_scale / sensor.electrons;
  const double step = sensor.full_scale / (std::exp2(sensor.bits) - 1.0);
  noise.shot.fill(unit);
  noise.read.fill(
      std::sqrt(unit * unit * sensor.read_noise_electrons * sensor.read_noise_electrons +
                step * step / 12.0));
  return StackNoise(frames, noise);
}

struct Noisy {
  Rig rig;
  RenderedRelief rendered;
  StackNoise noise;
};

inline Noisy NoisyScene(double exposure, unsigned seed, double max_slope_deg = 20.0) {
  const SensorModel sensor{.full_scale = exposure};
  Noisy noisy{TwoRings(), {}, NoiseOfSensor(sensor, 10)};
  noisy.rendered = RenderRelief({.shape = ReliefShape::kRipple,
                                 .max_slope_rad = max_slope_deg * kRadPerDeg,
                                 .sensor = sensor,
                                 .seed = seed},
                                noisy.rig, {160, 100})
                       .value();
  return noisy;
}

inline RenderedRelief RippleOf(const SensorModel& sensor, const Rig& rig, ImageSize size) {
  return RenderRelief(
             {.shape = ReliefShape::kRipple, .max_slope_rad = 15.0 * kRadPerDeg, .sensor = sensor},
             rig, size)
      .value();
}

}  // namespace sateen::testing
