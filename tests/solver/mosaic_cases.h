#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "core/angle.h"
#include "simulation/random.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "solver/mosaic/mosaic.h"
#include "tests/solver/solver_cases.h"

namespace sateen::testing {

inline constexpr std::array<uint8_t, 4> kRggb = {0, 1, 1, 2};
inline constexpr double kBlackDn = 500.0;
inline constexpr double kWhiteDn = 64000.0;
inline constexpr double kGainDn = 2.0;
inline constexpr double kReadDn = 8.0;
inline constexpr ImageSize kSize = {96, 70};

// Mosaics of a rendered scene as a 16-bit sensor reads them, and what they are made of.
struct Readings {
  std::vector<Image<uint16_t>> frames;
  MosaicStack stack;

  explicit Readings(const RenderedRelief& scene, const Rig& rig) {
    stack.size_px = scene.normal.Size();
    stack.cfa = kRggb;
    float most = 0.0F;
    for (const LightFrame& frame : scene.stack) {
      for (const Image<float>& plane : frame.rgb.planes) {
        most = std::max(most, *std::ranges::max_element(plane.pixels));
      }
    }
    const double per_dn = 1.1 * static_cast<double>(most) / (kWhiteDn - kBlackDn);
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      stack.lit.push_back(FrameOf(per_dn));
      Image<uint16_t> readings(stack.size_px);
      for (int y = 0; y < readings.height; ++y) {
        for (int x = 0; x < readings.width; ++x) {
          const size_t c = kRggb[static_cast<size_t>(y % 2 * 2 + x % 2)];
          const auto radiance = static_cast<double>(scene.stack[k].rgb[c].At(x, y));
          readings.At(x, y) = static_cast<uint16_t>(std::lround(kBlackDn + radiance / per_dn));
        }
      }
      frames.push_back(std::move(readings));
    }
  }

  static MosaicFrame FrameOf(double per_dn) {
    MosaicFrame frame{.saturated_dn = static_cast<float>(kWhiteDn),
                      .gain_dn = kGainDn,
                      .read_dn = kReadDn,
                      .name = "frame"};
    frame.per_dn.fill(static_cast<float>(per_dn));
    frame.at_zero.fill(static_cast<float>(-kBlackDn * per_dn));
    return frame;
  }

  void AddNoise(uint64_t seed) {
    uint64_t counter = 0;
    for (Image<uint16_t>& frame : frames) {
      for (uint16_t& reading : frame.pixels) {
        const double signal = static_cast<double>(reading) - kBlackDn;
        const double deviation = std::sqrt(kGainDn * signal + kReadDn * kReadDn);
        reading = static_cast<uint16_t>(
            std::lround(static_cast<double>(reading) + deviation * NormalDeviate(seed, counter++)));
      }
    }
  }

  void ForgetNoise() {
    for (MosaicFrame& frame : stack.lit) {
      frame.gain_dn = 0.0;
      frame.read_dn = 0.0;
    }
  }

  [[nodiscard]] NormalField Solve(const Rig& rig, const MosaicOptions& options = {},
                                  int threads = 0, const std::optional<Mask>& mask = std::nullopt,
                                  const std::optional<Image<float>>& height_mm = std::nullopt) {
    stack.rows = std::make_shared<MosaicsInMemory>(frames);
    return SolveMosaic(stack, rig, mask, options, {.threads = threads}, height_mm).value();
  }
};

inline MosaicOptions Plain(Backend backend = Backend::kAuto) {
  return {.mode = std::nullopt, .least_squares = {.backend = backend}};
}

inline MosaicOptions Ladder(LadderMode mode, Backend backend = Backend::kAuto) {
  return {.mode = mode, .least_squares = {.backend = backend}};
}

struct ErrorsAndUncertainty {
  double actual_over_predicted = 0.0;  // ratio of the root mean squares
  double standardised = 0.0;           // root mean square of error over uncertainty
  double standardised_albedo = 0.0;    // the same for the sites' own colours
};

inline ErrorsAndUncertainty CompareErrors(const NormalField& field, const RenderedRelief& truth,
                                          const std::array<uint8_t, 4>& cfa) {
  Image<float> error_deg;
  EXPECT_TRUE(AngularErrorDeg(field, truth.normal, &error_deg));
  double squares = 0.0;
  double predicted = 0.0;
  double standardised = 0.0;
  double standardised_albedo = 0.0;
  const Image<float> albedo_error = AlbedoErrorMap(field, truth.albedo, &cfa).value();
  for (size_t p = 0; p < error_deg.pixels.size(); ++p) {
    const auto e = static_cast<double>(error_deg.pixels[p]);
    const auto u = static_cast<double>(field.uncertainty.pixels[p]);
    squares += e * e;
    predicted += u * u;
    standardised += e * e / (u * u);
    standardised_albedo += std::pow(
        static_cast<double>(albedo_error.pixels[p] / field.albedo_uncertainty.pixels[p]), 2.0);
  }
  return {.actual_over_predicted = std::sqrt(squares / predicted),
          .standardised = std::sqrt(standardised / static_cast<double>(error_deg.pixels.size())),
          .standardised_albedo =
              std::sqrt(standardised_albedo / static_cast<double>(error_deg.pixels.size()))};
}

}  // namespace sateen::testing
