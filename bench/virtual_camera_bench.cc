// Frames of the virtual rig's camera at the size of a D5100, 4928 x 3264, on one core.
#include <benchmark/benchmark.h>

#include <cmath>

#include "imaging/dng.h"
#include "simulation/virtual_rig/camera/scene_frame.h"

namespace {

using sateen::FrameState;
using sateen::Image;
using sateen::ImageSize;
using sateen::LitScene;
using sateen::Sensor;

constexpr ImageSize kSizePx = {4928, 3264};

const LitScene& Scene() {
  static const LitScene kScene = [] {
    LitScene scene{.lights = {2, Image<float>(kSizePx)}, .ambient = Image<float>(kSizePx, 0.01F)};
    for (Image<float>& light : scene.lights) {
      for (size_t p = 0; p < light.pixels.size(); ++p) {
        light.pixels[p] = 0.4F + 0.3F * std::sin(static_cast<float>(p % 977));
      }
    }
    return scene;
  }();
  return kScene;
}

const Sensor kSensor = *sateen::SensorNamed("nikon-d5100");

// As the camera does it: the readings, and the bytes of the file.
void Frame(benchmark::State& run, const FrameState& state) {
  for (auto _ : run) {
    const auto mosaic = sateen::FrameOfScene(Scene(), kSensor, state);
    const auto bytes = sateen::EncodeDng(mosaic, {.white = kSensor.white_dn});
    benchmark::DoNotOptimize(bytes->data());
  }
}

void FrameOfOneLight(benchmark::State& run) { Frame(run, {.shares = {1.0, 0.0}}); }
void FrameOfAmbientLightOnly(benchmark::State& run) { Frame(run, {.shares = {0.0, 0.0}}); }
void FrameOfTwoLights(benchmark::State& run) { Frame(run, {.shares = {0.5, 0.5}}); }
void FrameOfOneLightNudged(benchmark::State& run) {
  Frame(run, {.shares = {1.0, 0.0}, .shift_x_px = 3.0, .shift_y_px = 0.5});
}
void FileAlone(benchmark::State& run) {
  const Image<uint16_t> mosaic(kSizePx, 1000);
  for (auto _ : run) {
    const auto bytes = sateen::EncodeDng(mosaic, {.white = kSensor.white_dn});
    benchmark::DoNotOptimize(bytes->data());
  }
}

BENCHMARK(FrameOfOneLight)->Unit(benchmark::kMillisecond);
BENCHMARK(FrameOfAmbientLightOnly)->Unit(benchmark::kMillisecond);
BENCHMARK(FrameOfTwoLights)->Unit(benchmark::kMillisecond);
BENCHMARK(FrameOfOneLightNudged)->Unit(benchmark::kMillisecond);
BENCHMARK(FileAlone)->Unit(benchmark::kMillisecond);

}  // namespace
