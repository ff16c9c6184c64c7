// Solving from the mosaic against solving from interpolated colours: time and error in memory, from
// files to maps, and memory of large captures. `mosaic_bench --full` takes the sizes of the bars.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "core/angle.h"
#include "core/parallel.h"
#include "imaging/raw.h"
#include "simulation/random.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "solver/evaluate.h"
#include "solver/ladder.h"
#include "solver/mosaic.h"

namespace {

using sateen::Image;
using sateen::NormalField;

constexpr double kBlackDn = 600.0;
constexpr double kWhiteDn = 16383.0;
constexpr double kElectrons = 45000.0;
constexpr double kReadElectrons = 4.0;
constexpr std::array<uint8_t, 4> kRggb = {0, 1, 1, 2};

double BestSeconds(int repeats, const std::function<void()>& run) {
  double best = 1e9;
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    run();
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    best = std::min(best, spent.count());
  }
  return best;
}

// A rendered relief as a 14-bit sensor reads it.
struct Scene {
  sateen::Rig rig;
  sateen::Image3 normal;
  std::vector<Image<uint16_t>> readings;
  sateen::MosaicStack stack;
  double per_dn = 0.0;
};

Scene MakeScene(sateen::ImageSize size) {
  Scene scene{.rig = sateen::RingRig(size)};
  const sateen::ReliefScene relief{.shape = sateen::ReliefShape::kRipple,
                                   .max_slope_rad = 30.0 * sateen::kRadPerDeg};
  sateen::RenderedRelief rendered = sateen::RenderRelief(relief, scene.rig, size).value();
  scene.normal = std::move(rendered.normal);
  float most = 0.0F;
  for (const sateen::LightFrame& frame : rendered.stack) {
    for (const Image<float>& plane : frame.rgb.planes) {
      most = std::max(most, *std::ranges::max_element(plane.pixels));
    }
  }
  scene.per_dn = 1.2 * static_cast<double>(most) / (kWhiteDn - kBlackDn);
  const double gain_dn = (kWhiteDn - kBlackDn) / kElectrons;
  const double read_dn = kReadElectrons * gain_dn;
  scene.stack = {.size_px = size, .cfa = kRggb};
  for (size_t k = 0; k < rendered.stack.size(); ++k) {
    Image<uint16_t> readings(size);
    const sateen::Image3& rgb = rendered.stack[k].rgb;
    static_cast<void>(sateen::ParallelFor(size.height, 16, {}, [&](int begin, int end) {
      for (size_t p = readings.Index(0, begin); p < readings.Index(0, end); ++p) {
        const size_t y = p / static_cast<size_t>(size.width);
        const size_t x = p % static_cast<size_t>(size.width);
        const double signal =
            static_cast<double>(rgb[kRggb[y % 2 * 2 + x % 2]].pixels[p]) / scene.per_dn;
        const double noise =
            std::sqrt(gain_dn * signal + read_dn * read_dn) * sateen::NormalDeviate(k, p);
        readings.pixels[p] = static_cast<uint16_t>(
            std::clamp(std::lround(kBlackDn + signal + noise), 0L, std::lround(kWhiteDn)));
      }
    }));
    scene.readings.push_back(std::move(readings));
    rendered.stack[k] = {};
    sateen::MosaicFrame frame{.saturated_dn = static_cast<float>(kWhiteDn),
                              .gain_dn = gain_dn,
                              .read_dn = read_dn,
                              .name = "frame"};
    frame.per_dn.fill(static_cast<float>(scene.per_dn));
    frame.at_zero.fill(static_cast<float>(-kBlackDn * scene.per_dn));
    scene.stack.lit.push_back(frame);
  }
  return scene;
}

sateen::LightStack Demosaiced(const Scene& scene) {
  sateen::LightStack stack(scene.readings.size());
  static_cast<void>(sateen::ParallelFor(
      static_cast<int>(scene.readings.size()), 1, {}, [&](int begin, int /*end*/) {
        const auto k = static_cast<size_t>(begin);
        sateen::RawMosaic mosaic{.samples = Image<float>(scene.stack.size_px), .cfa = kRggb};
        std::ranges::transform(
            scene.readings[k].pixels, mosaic.samples.pixels.begin(), [&](uint16_t reading) {
              return static_cast<float>((static_cast<double>(reading) - kBlackDn) * scene.per_dn);
            });
        stack[k] = {.rgb = sateen::Demosaic(mosaic),
                    .full_scale = static_cast<float>((kWhiteDn - kBlackDn) * scene.per_dn),
                    .raw = true};
      }));
  return stack;
}

sateen::StackNoise NoiseOf(const Scene& scene) {
  sateen::SampleNoise noise;
  noise.shot.fill(scene.stack.lit[0].gain_dn * scene.per_dn);
  noise.read.fill(scene.stack.lit[0].read_dn * scene.per_dn);
  return sateen::StackNoise(scene.readings.size(), noise);
}

void MeasureInMemory(sateen::ImageSize size, int repeats) {
  Scene scene = MakeScene(size);
  const sateen::MosaicsInMemory rows(scene.readings);
  scene.stack.rows = &rows;
  const auto ns = [&](double seconds) {
    return 1e9 * seconds / static_cast<double>(size.PixelCount());
  };
  const auto error_deg = [&](const NormalField& field) {
    return sateen::AngularErrorDeg(field, scene.normal)->mean;
  };
  fmt::print("{} x {} px, {} near lights, mosaics in memory\n", size.width, size.height,
             scene.readings.size());
  NormalField field;
  sateen::LightStack stack;
  const double demosaic = BestSeconds(repeats, [&] { stack = Demosaiced(scene); });
  const double rgb = BestSeconds(repeats, [&] {
    static_cast<void>(sateen::SolveLambertianInto(stack, scene.rig, std::nullopt, {}, {}, field));
  });
  const double rgb_deg = error_deg(field);
  const sateen::LadderOptions ladder{.noise = NoiseOf(scene)};
  const double rgb_ladder = BestSeconds(repeats, [&] {
    static_cast<void>(sateen::SolveLadderInto(stack, scene.rig, std::nullopt, ladder, {}, field));
  });
  const double rgb_ladder_deg = error_deg(field);
  stack.clear();
  const auto raw_of = [&](const sateen::MosaicOptions& options, double& deg) {
    const double seconds = BestSeconds(repeats, [&] {
      static_cast<void>(
          sateen::SolveMosaicInto(scene.stack, scene.rig, std::nullopt, options, {}, field));
    });
    deg = error_deg(field);
    return seconds;
  };
  double raw_deg = 0.0;
  double raw_ladder_deg = 0.0;
  const double raw = raw_of({.mode = std::nullopt}, raw_deg);
  const double raw_ladder = raw_of({}, raw_ladder_deg);
  fmt::print("{:<40} {:>8} {:>10}\n", "", "ns/px", "mean deg");
  fmt::print("{:<40} {:>8.1f}\n", "interpolating the colours", ns(demosaic));
  fmt::print("{:<40} {:>8.1f} {:>10.4f}\n", "least squares, RGB", ns(rgb), rgb_deg);
  fmt::print("{:<40} {:>8.1f} {:>10.4f}\n", "least squares, RAW", ns(raw), raw_deg);
  fmt::print("{:<40} {:>8.1f} {:>10.4f}\n", "ladder, RGB", ns(rgb_ladder), rgb_ladder_deg);
  fmt::print("{:<40} {:>8.1f} {:>10.4f}\n", "ladder, RAW", ns(raw_ladder), raw_ladder_deg);
  fmt::print("RAW / RGB: least squares {:.2f}, ladder {:.2f}; of the solve alone {:.2f}, {:.2f}\n",
             raw / (demosaic + rgb), raw_ladder / (demosaic + rgb_ladder), raw / rgb,
             raw_ladder / rgb_ladder);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Solving from the mosaic against solving from interpolated colours", "mosaic_bench");
  bool full = false;
  app.add_flag("--full", full, "The sizes of the bars");
  CLI11_PARSE(app, argc, argv);
  MeasureInMemory(full ? sateen::ImageSize{4928, 3264} : sateen::ImageSize{1232, 816}, 3);
  return 0;
}
