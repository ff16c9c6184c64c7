#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "calibration/response/chart_readings.h"
#include "simulation/random.h"

namespace sateen::testing {

inline constexpr std::array<double, 5> kReflectance = {0.9, 0.5, 0.2, 0.1, 0.04};
inline constexpr int kSide = 48;  // sites of a patch

// A sensor of which everything is known, before a chart of five patches.
struct Bench {
  double black_dn = 512.0;
  double white_dn = 16383.0;
  double saturation_dn = 15000.0;
  double gain = 0.4;  // DN per electron
  double read_noise_dn = 2.0;
  std::array<double, 3> sensitivity = {0.5, 1.0, 0.7};
  std::vector<double> times_s = {0.001, 0.002,  0.004,  0.008, 0.0113,
                                 0.016, 0.0226, 0.0253, 0.037, 0.0517};
  int repeats = 2;
  size_t lights = 1;
  uint64_t seed = 1000;
  double dn_per_s = 600000.0;  // rate of a white diffuser, green
  double ambient_dn_per_s = 0.0;
  std::function<double(double)> bend = [](double dn) { return dn; };
  // How the light falls at a site of a patch, and how bright it is in a frame.
  std::function<double(size_t patch, int x, int y)> shading = [](size_t patch, int x, int) {
    return 1.0 - 0.1 * static_cast<double>(patch) + 0.0002 * x;
  };
  std::function<double(size_t frame)> flicker = [](size_t) { return 1.0; };

  [[nodiscard]] std::vector<uint16_t> Patch(size_t patch, std::optional<size_t> light,
                                            double time_s, size_t frame) const {
    std::vector<uint16_t> dn;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const size_t c = ColourAt(x, y);
        const double lit = light ? kReflectance[patch] * sensitivity[c] * shading(patch, x, y) *
                                       dn_per_s * time_s * flicker(frame) * LightColour(*light, c)
                                 : 0.0;
        const double signal = lit + kReflectance[patch] * ambient_dn_per_s * time_s;
        const double sd = std::sqrt(gain * signal + read_noise_dn * read_noise_dn);
        const uint64_t place =
            (patch * kSide + static_cast<size_t>(y)) * kSide + static_cast<size_t>(x);
        const double noisy = signal + sd * NormalDeviate(seed + frame, place);
        dn.push_back(static_cast<uint16_t>(
            std::clamp(std::round(black_dn + bend(noisy)), 0.0, saturation_dn)));
      }
    }
    return dn;
  }
  static size_t ColourAt(int x, int y) { return x % 2 != y % 2 ? 1 : x % 2 == 0 ? 0 : 2; }
  static double LightColour(size_t light, size_t colour) {
    return 1.0 + 0.05 * static_cast<double>(light) * (static_cast<double>(colour) - 1.0);
  }

  [[nodiscard]] ChartReadings Readings() const {
    ChartReadings readings;
    readings.file_black_dn = black_dn;
    readings.file_white_dn = white_dn;
    for (size_t patch = 0; patch < kReflectance.size(); ++patch) {
      PatchSites sites;
      for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) {
          sites.colour.push_back(static_cast<uint8_t>(ColourAt(x, y)));
          sites.block.push_back(static_cast<uint8_t>(y * kPatchBlocks / kSide * kPatchBlocks +
                                                     x * kPatchBlocks / kSide));
        }
      }
      readings.patches.push_back(sites);
      readings.patch_names.push_back(fmt::format("p{}", patch));
      readings.reflectance_rgb.push_back(Eigen::Vector3d::Constant(kReflectance[patch]));
    }
    const auto add = [&](std::optional<size_t> light, double time_s) {
      const size_t frame = readings.frames.size();
      ChartFrame one{.file = fmt::format("f{}", frame), .light = light, .exposure_s = time_s};
      for (size_t patch = 0; patch < kReflectance.size(); ++patch) {
        one.dn.push_back(Patch(patch, light, time_s, frame));
      }
      readings.frames.push_back(one);
    };
    for (size_t light = 0; light < lights; ++light) {
      readings.lights.push_back(fmt::format("led-{}", light));
      for (const double time_s : times_s) {
        for (int repeat = 0; repeat < repeats; ++repeat) {
          add(light, time_s);
        }
      }
    }
    for (int repeat = 0; repeat < repeats; ++repeat) {
      add(std::nullopt, times_s.front());
      add(std::nullopt, times_s.back());
    }
    return readings;
  }
};

}  // namespace sateen::testing
