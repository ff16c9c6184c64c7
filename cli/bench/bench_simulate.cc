#include "cli/bench/bench_simulate.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>
#include <ostream>
#include <utility>

#include "cli/bench/bench_simulate_report.h"
#include "cli/bench/peak_memory.h"
#include "cli/bench/scene_switches.h"
#include "core/files/own_folder.h"
#include "imaging/dng.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "imaging/show/pictures.h"
#include "simulation/render.h"
#include "simulation/sensor.h"
#include "solver/lambertian.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kRepeats = 2;         // of a switch; the faster counts
constexpr int kBenchPanelPx = 171;  // of a picture of two or three
constexpr double kFullScale = 0.8;  // radiance that saturates the sensor

// Adds the seconds that `run` takes to `seconds`.
template <typename Run>
auto Timed(double& seconds, const Run& run) {
  const auto start = std::chrono::steady_clock::now();
  auto result = run();
  seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

// A frame as the solver reads it: through `sensor`, where there is one.
Result<Image3> Seen(Image3 radiance, const std::optional<Sensor>& sensor, size_t light,
                    const Task& task) {
  if (!sensor) {
    return radiance;
  }
  const Result<Image<uint16_t>> mosaic = Expose(*sensor, radiance, light, task);
  if (!mosaic) {
    return tl::unexpected(mosaic.error());
  }
  RawMosaic raw{.samples = Image<float>(radiance.Size()), .cfa = sensor->cfa};
  const double range_dn = (sensor->white_dn - sensor->black_dn) / sensor->full_scale;
  std::ranges::transform(mosaic->pixels, raw.samples.pixels.begin(), [&](uint16_t dn) {
    return static_cast<float>((dn - sensor->black_dn) / range_dn);
  });
  return Demosaic(raw);
}

class SimulateBench {
 public:
  SimulateBench(const BenchSimulateArgs& args, const Task& task) : args_(args), task_(task) {
    report_.size = {args.width, args.height};
    report_.threads = task.ThreadCount();
  }

  Result<SimulateBenchReport> Run() {
    Status status = MeasureSession();
    report_.peak_memory_gb = PeakMemoryGb();
    const std::vector<SceneSwitch> switches = SceneSwitches();
    task_.BeginStage("switches", static_cast<int>(switches.size()));
    for (const SceneSwitch& one : switches) {
      if (status) {
        status = MeasureSwitch(one);
      }
    }
    if (status && !args_.pictures.empty()) {
      status = DrawShapes();
    }
    if (!status) {
      return tl::unexpected(status.error());
    }
    return std::move(report_);
  }

 private:
  [[nodiscard]] Task Quiet() const { return {.threads = task_.threads, .cancel = task_.cancel}; }

  // Does the work of `sateen simulate` for a RAW session, step by step.
  Status MeasureSession() {
    const Result<OwnFolder> scratch = MakeScratchFolder("bench-simulate");
    Result<Scene> scene = scratch ? PlainScene(report_.size) : tl::unexpected(scratch.error());
    Sensor sensor = *SensorNamed("nikon-d5100");
    sensor.full_scale = kFullScale;
    if (!scene) {
      return tl::unexpected(scene.error());
    }
    const size_t lights = scene->rig.lights.size();
    report_.frames = static_cast<int>(lights) + 1;
    task_.BeginStage("session", report_.frames);
    double geometry_s = 0.0;
    double shading_s = 0.0;
    double sensor_s = 0.0;
    double writing_s = 0.0;
    Result<SceneRenderer> renderer =
        Timed(geometry_s, [&] { return SceneRenderer::Create(*scene, Quiet()); });
    if (!renderer) {
      return tl::unexpected(renderer.error());
    }
    for (size_t k = 0; k <= lights; ++k) {
      const std::optional<size_t> light = k < lights ? std::optional(k) : std::nullopt;
      const Result<RenderedFrame> frame =
          Timed(shading_s, [&] { return renderer->Render(light, Quiet()); });
      if (!frame) {
        return tl::unexpected(frame.error());
      }
      const Result<Image<uint16_t>> mosaic =
          Timed(sensor_s, [&] { return Expose(sensor, frame->radiance, k, Quiet()); });
      if (!mosaic) {
        return tl::unexpected(mosaic.error());
      }
      const DngHeader header{.cfa = sensor.cfa, .black = sensor.black_dn, .white = sensor.white_dn};
      const fs::path file = scratch->Path() / fmt::format("{}.dng", k);
      if (Status status = Timed(writing_s, [&] { return WriteDng(file, *mosaic, header); });
          !status) {
        return status;
      }
      task_.Advance();
    }
    const double samples = static_cast<double>(report_.size.PixelCount()) * report_.frames;
    for (const auto& [name, seconds] : {std::pair{"geometry", geometry_s},
                                        {"shading", shading_s},
                                        {"sensor", sensor_s},
                                        {"writing", writing_s}}) {
      report_.stages.push_back({name, seconds, 1e9 * seconds / samples});
      report_.seconds += seconds;
    }
    return {};
  }

  Status MeasureSwitch(const SceneSwitch& one) {
    const ImageSize size{args_.switch_width, args_.switch_width};
    Result<Scene> scene = PlainScene(size);
    if (!scene) {
      return tl::unexpected(scene.error());
    }
    one.turn_on(*scene);
    double best_s = std::numeric_limits<double>::infinity();
    LightStack stack;
    Image3 truth;
    for (int repeat = 0; repeat < kRepeats; ++repeat) {
      double seconds = 0.0;
      Result<SceneRenderer> renderer =
          Timed(seconds, [&] { return SceneRenderer::Create(*scene, Quiet()); });
      if (!renderer) {
        return tl::unexpected(renderer.error());
      }
      truth = renderer->Maps().normal;
      stack.clear();
      for (size_t k = 0; k < scene->rig.lights.size(); ++k) {
        Result<Image3> frame = Timed(seconds, [&] {
          return renderer->Render(k, Quiet()).and_then([&](RenderedFrame&& rendered) {
            return Seen(std::move(rendered.radiance), one.sensor, k, Quiet());
          });
        });
        if (!frame) {
          return tl::unexpected(frame.error());
        }
        stack.push_back({.rgb = std::move(*frame)});
      }
      best_s = std::min(best_s, seconds);
    }
    const Result<NormalField> field =
        SolveLambertian(stack, scene->rig, std::nullopt, LambertianOptions{}, Quiet());
    if (!field) {
      return tl::unexpected(field.error());
    }
    const double ns = 1e9 * best_s / static_cast<double>(size.PixelCount() * stack.size());
    const double plain_ns = report_.switches.empty() ? ns : report_.switches[0].ns_per_pixel;
    report_.switches.push_back({.name = std::string(one.key),
                                .ns_per_pixel = ns,
                                .times_plain = ns / plain_ns,
                                .angular_error_deg = *AngularErrorDeg(*field, truth)});
    task_.Advance();
    return task_.CheckCancelled().and_then([&] { return Draw(one, stack.back().rgb); });
  }

  // The frame of the last light without and with the switch, equally exposed.
  Status Draw(const SceneSwitch& one, const Image3& frame) {
    if (args_.pictures.empty()) {
      return {};
    }
    if (plain_frame_.planes[0].pixels.empty()) {
      plain_frame_ = frame;
    }
    const float white = WhiteOf(plain_frame_);
    const std::string file = (args_.pictures / fmt::format("{}.png", one.file)).string();
    return WritePng8(file, SideBySide({ShowLinear(plain_frame_, white), ShowLinear(frame, white)},
                                      kBenchPanelPx));
  }

  // Each shape: the frame of the last light, normals, height from black to white.
  Status DrawShapes() {
    for (const SceneShape& shape : SceneShapes()) {
      const Result<Scene> scene = ShapeScene(shape, {args_.switch_width, args_.switch_width});
      if (!scene) {
        return tl::unexpected(scene.error());
      }
      Result<SceneRenderer> renderer = SceneRenderer::Create(*scene, Quiet());
      if (!renderer) {
        return tl::unexpected(renderer.error());
      }
      const Result<RenderedFrame> frame = renderer->Render(scene->rig.lights.size() - 1, Quiet());
      if (!frame) {
        return tl::unexpected(frame.error());
      }
      const std::vector<Rgb8> panels = {ShowLinear(frame->radiance),
                                        ShowNormal(renderer->Maps().normal),
                                        ShowRelief(renderer->Maps().point_mm[2])};
      const std::string file = (args_.pictures / fmt::format("shape-{}.png", shape.file)).string();
      if (Status status = WritePng8(file, SideBySide(panels, kBenchPanelPx)); !status) {
        return status;
      }
    }
    return {};
  }

  const BenchSimulateArgs& args_;
  const Task task_;
  Image3 plain_frame_;  // of the last light, for the pictures
  SimulateBenchReport report_;
};

}  // namespace

void AddBenchSimulate(CLI::App& bench, BenchSimulateArgs& args) {
  CLI::App* cmd = bench.add_subcommand(
      "simulate",
      "A RAW session step by step: time and memory; then each switch of a scene: time "
      "and what it does to a solve");
  cmd->add_option("--width", args.width, "Width of the session's frames [px]")
      ->check(CLI::Range(32, 20000))
      ->capture_default_str();
  cmd->add_option("--height", args.height, "Height of the session's frames [px]")
      ->check(CLI::Range(32, 20000))
      ->capture_default_str();
  cmd->add_option("--switch-width", args.switch_width,
                  "Width and height of the frames for the switches [px]")
      ->check(CLI::Range(32, 20000))
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_option(
      "--pictures", args.pictures,
      "A folder for a picture of each switch: the last light's frame without and with it");
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the tables");
  cmd->footer("Frames are written to a folder under $TMPDIR, or /tmp, and removed.");
}

int RunBenchSimulate(const BenchSimulateArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log) {
  std::error_code error;
  if (!args.pictures.empty() && !fs::create_directories(args.pictures, error) && error) {
    log << fmt::format("sateen bench simulate: error: {}: {}; need a folder for the pictures\n",
                       args.pictures.string(), error.message());
    return ExitStatus(Error{ErrorCode::kIo, ""});
  }
  const Result<SimulateBenchReport> report =
      SimulateBench(args, task.WithThreads(args.threads)).Run();
  task.ClearProgress();
  if (!report) {
    log << "sateen bench simulate: error: " << report.error().message << '\n';
    return ExitStatus(report.error());
  }
  out << (args.json ? JsonReport(*report) : TextReport(*report));
  return 0;
}

}  // namespace sateen::cli
