// Single parts of the solver on one thread: the kernel per light model, with ordinary and with
// subnormal radiance, and with the noise for weights; the bytes alone; table positions; one pixel
// of the reference.

#include <benchmark/benchmark.h>

#include <vector>

#include "bench/memory_floor/memory_floor.h"
#include "rig/table_grid.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "solver/least_squares/fast_rows.h"

namespace sateen {
namespace {

constexpr ImageSize kSize{1024, 512};

struct Scene {
  Rig rig;
  RenderedRelief relief;
};

Scene MakeScene(LightModel model, float radiance_factor) {
  Scene scene{RingRig(kSize, model), {}};
  scene.relief = RenderRelief({.shape = ReliefShape::kRipple}, scene.rig, kSize).value();
  for (LightFrame& frame : scene.relief.stack) {
    for (Image<float>& plane : frame.rgb.planes) {
      for (float& value : plane.pixels) {
        value *= radiance_factor;
      }
    }
  }
  return scene;
}

void CountPixels(benchmark::State& state, size_t pixels) {
  state.counters["per_px"] = benchmark::Counter(
      static_cast<double>(pixels),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void BM_Touch(benchmark::State& state) {
  const Scene scene = MakeScene(LightModel::kNear, 1.0F);
  NormalField field;
  field.Resize(kSize);
  const int step = RowsPerPiece(kSize);
  for (auto _ : state) {
    for (int row = 0; row < kSize.height; row += step) {
      TouchRows(scene.relief.stack, row, row + step, field);
    }
    benchmark::DoNotOptimize(field.normal[0].pixels.data());
  }
  CountPixels(state, kSize.PixelCount());
}
BENCHMARK(BM_Touch);

void BM_Rows(benchmark::State& state, LightModel model, float radiance_factor) {
  const Scene scene = MakeScene(model, radiance_factor);
  const FastRows rows = FastRows::Make({scene.relief.stack, scene.rig}, {}).value();
  NormalField field;
  field.Resize(kSize);
  const int step = RowsPerPiece(kSize);
  for (auto _ : state) {
    for (int row = 0; row < kSize.height; row += step) {
      rows.Solve(row, row + step, field);
    }
    benchmark::DoNotOptimize(field.normal[0].pixels.data());
  }
  CountPixels(state, kSize.PixelCount());
}
BENCHMARK_CAPTURE(BM_Rows, distant, LightModel::kDistant, 1.0F);
BENCHMARK_CAPTURE(BM_Rows, near, LightModel::kNear, 1.0F);
BENCHMARK_CAPTURE(BM_Rows, near_subnormal, LightModel::kNear, 1e-40F);
BENCHMARK_CAPTURE(BM_Rows, led, LightModel::kLed, 1.0F);
BENCHMARK_CAPTURE(BM_Rows, led_field, LightModel::kLedField, 1.0F);

void BM_WeightedRows(benchmark::State& state, LightModel model) {
  const Scene scene = MakeScene(model, 1.0F);
  const StackNoise noise(scene.relief.stack.size(),
                         {.shot = {1e-4, 1e-4, 1e-4}, .read = {1e-4, 1e-4, 1e-4}});
  const FastRows rows = FastRows::Make({scene.relief.stack, scene.rig}, {}, &noise).value();
  NormalField field;
  field.Resize(kSize, /*with_ladder=*/true);
  const int step = RowsPerPiece(kSize);
  std::vector<float> misfits(static_cast<size_t>(step) * static_cast<size_t>(kSize.width));
  for (auto _ : state) {
    for (int row = 0; row < kSize.height; row += step) {
      rows.SolveWeighted(row, row + step, rows.GeometryOf(row, row + step), 1.0, field, misfits);
    }
    benchmark::DoNotOptimize(field.normal[0].pixels.data());
  }
  CountPixels(state, kSize.PixelCount());
}
BENCHMARK_CAPTURE(BM_WeightedRows, distant, LightModel::kDistant);
BENCHMARK_CAPTURE(BM_WeightedRows, near, LightModel::kNear);

void BM_TablePositions(benchmark::State& state) {
  const Rig rig = RingRig(kSize);
  const TableGrid grid = TableGrid::Make(*rig.camera).value();
  std::vector<float> x_mm(static_cast<size_t>(kSize.width));
  std::vector<float> y_mm(x_mm.size());
  int row = 0;
  for (auto _ : state) {
    grid.Row(row, x_mm, y_mm);
    benchmark::DoNotOptimize(x_mm.data());
    row = (row + 1) % kSize.height;
  }
  CountPixels(state, x_mm.size());
}
BENCHMARK(BM_TablePositions);

void BM_ReferencePixel(benchmark::State& state) {
  const Scene scene = MakeScene(LightModel::kNear, 1.0F);
  Mask one_in_a_hundred(kSize);
  size_t pixels = 0;
  for (size_t p = 0; p < one_in_a_hundred.pixels.size(); p += 101) {
    one_in_a_hundred.pixels[p] = 1;
    ++pixels;
  }
  NormalField field;
  for (auto _ : state) {
    const Status status =
        SolveLambertianInto(scene.relief.stack, scene.rig, one_in_a_hundred,
                            {.backend = Backend::kJacobiSvd}, {.threads = 1}, field);
    benchmark::DoNotOptimize(status.has_value());
  }
  CountPixels(state, pixels);
}
BENCHMARK(BM_ReferencePixel);

}  // namespace
}  // namespace sateen
