#include "cli/bench_simulate.h"

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "core/angle.h"
#include "imaging/dng.h"
#include "reflectance/specular.h"
#include "simulation/render.h"
#include "simulation/rigs.h"
#include "simulation/sensor.h"
#include "solver/lambertian.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kBytesPerGb = 1e9;
constexpr double kFullScale = 0.8;  // radiance that saturates the sensor

// A folder of its own for the frames, removed with all in it.
class ScratchFolder {
 public:
  ScratchFolder()
      : path_(fs::temp_directory_path() / fmt::format("sateen-bench-simulate-{}", getpid())) {}
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  [[nodiscard]] Status Create() const {
    std::error_code error;
    fs::create_directory(path_, error);
    return error ? Status(Fail(ErrorCode::kIo, "{}: cannot be created: {}; set TMPDIR",
                               path_.string(), error.message()))
                 : Status();
  }
  [[nodiscard]] const fs::path& Path() const { return path_; }

 private:
  fs::path path_;
};

double PeakMemoryGb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / kBytesPerGb;
}

// Adds the seconds that `run` takes to `seconds`.
template <typename Run>
auto Timed(double& seconds, const Run& run) {
  const auto start = std::chrono::steady_clock::now();
  auto result = run();
  seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

// Waves of fabric size under ten near lights, nothing else.
Result<Scene> PlainScene(ImageSize size) {
  Scene scene;
  scene.rig = RingRig(size);
  Result<SurfacePtr> waves = MakeWaves(30.0, 35.0 * kRadPerDeg);
  if (!waves) {
    return tl::unexpected(waves.error());
  }
  scene.surface = std::move(*waves);
  scene.materials = {{.albedo = WavyAlbedo{.min = 0.2, .max = 0.8, .period_mm = 160.0}}};
  return scene;
}

struct Switch {
  const char* name;
  std::function<void(Scene&)> turn_on;
};

std::vector<Switch> Switches() {
  return {
      {"plain: near lights, Lambert", [](Scene&) {}},
      {"shadows: none", [](Scene& scene) { scene.illumination.shadows = Shadows::kNone; }},
      {"shadows: cast, 3 x 3 places",
       [](Scene& scene) { scene.illumination.shadows = Shadows::kCast; }},
      {"bounce_rays: 16", [](Scene& scene) { scene.illumination.bounce_rays = 16; }},
      {"ambient_rgb: 0.02", [](Scene& scene) { scene.illumination.ambient_rgb.setConstant(0.02); }},
      {"flicker: 0.01", [](Scene& scene) { scene.illumination.flicker = 0.01; }},
      {"specular: ggx, alpha 0.3",
       [](Scene& scene) {
         scene.materials[0].specular = std::make_shared<const Ggx>(SpecularSpec{.alpha = 0.3});
       }},
      {"specular: cloth, alpha 0.6",
       [](Scene& scene) {
         scene.materials[0].specular = std::make_shared<const Cloth>(SpecularSpec{.alpha = 0.6});
       }},
      {"vignetting: -0.3",
       [](Scene& scene) {
         scene.lens.vignetting = {-0.3, 0.0, 0.0};
       }},
      {"psf_sigma_px: 1", [](Scene& scene) { scene.lens.psf_sigma_px = 1.0; }},
      {"samples: 3", [](Scene& scene) { scene.lens.samples = 3; }},
      {"bump: 0.5 px half-way",
       [](Scene& scene) {
         scene.lens.bump_from = scene.rig.lights[scene.rig.lights.size() / 2].name;
         scene.lens.bump_px = {0.5, 0.0};
       }},
  };
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
    const std::vector<Switch> switches = Switches();
    task_.BeginStage("switches", static_cast<int>(switches.size()));
    for (const Switch& one : switches) {
      if (status) {
        status = MeasureSwitch(one);
      }
    }
    if (!status) {
      return tl::unexpected(status.error());
    }
    return std::move(report_);
  }

 private:
  [[nodiscard]] Task Quiet() const { return {.threads = task_.threads, .cancel = task_.cancel}; }

  // What `sateen simulate` does for a RAW session, step by step.
  Status MeasureSession() {
    const ScratchFolder scratch;
    Result<Scene> scene = scratch.Create().and_then([&] { return PlainScene(report_.size); });
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
      const fs::path file = scratch.Path() / fmt::format("{}.dng", k);
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

  Status MeasureSwitch(const Switch& one) {
    const ImageSize size{args_.switch_width, args_.switch_width};
    Result<Scene> scene = PlainScene(size);
    if (!scene) {
      return tl::unexpected(scene.error());
    }
    one.turn_on(*scene);
    double seconds = 0.0;
    Result<SceneRenderer> renderer =
        Timed(seconds, [&] { return SceneRenderer::Create(*scene, Quiet()); });
    if (!renderer) {
      return tl::unexpected(renderer.error());
    }
    LightStack stack;
    stack.reserve(scene->rig.lights.size());
    for (size_t k = 0; k < scene->rig.lights.size(); ++k) {
      Result<RenderedFrame> frame = Timed(seconds, [&] { return renderer->Render(k, Quiet()); });
      if (!frame) {
        return tl::unexpected(frame.error());
      }
      stack.push_back({.rgb = std::move(frame->radiance)});
    }
    const Result<NormalField> field =
        SolveLambertian(stack, scene->rig, std::nullopt, LambertianOptions{}, Quiet());
    if (!field) {
      return tl::unexpected(field.error());
    }
    const double samples = static_cast<double>(size.PixelCount() * stack.size());
    const double ns = 1e9 * seconds / samples;
    report_.switches.push_back(
        {.name = one.name,
         .ns_per_pixel = ns,
         .times_plain = report_.switches.empty() ? 1.0 : ns / report_.switches.front().ns_per_pixel,
         .angular_error_deg = *AngularErrorDeg(*field, renderer->Maps().normal)});
    task_.Advance();
    return task_.CheckCancelled();
  }

  const BenchSimulateArgs& args_;
  const Task task_;
  SimulateBenchReport report_;
};

std::string SimulateText(const SimulateBenchReport& report) {
  std::string text = fmt::format(
      "A session of {} frames of {} x {} ({:.1f} megapixels), near lights, Lambertian, 14-bit "
      "sensor\nwith noise, DNG files; {} threads\n\n  {:<10} {:>8}  {:>20}\n",
      report.frames, report.size.width, report.size.height,
      1e-6 * static_cast<double>(report.size.PixelCount()), report.threads, "step", "seconds",
      "ns a pixel and frame");
  for (const SimulateStage& stage : report.stages) {
    text += fmt::format("  {:<10} {:>8.2f}  {:>20.1f}\n", stage.name, stage.seconds,
                        stage.ns_per_pixel);
  }
  text += fmt::format("  {:<10} {:>8.2f}\n\nPeak memory {:.2f} GB\n\n", "all", report.seconds,
                      report.peak_memory_gb);
  text += fmt::format(
      "What each switch of a scene costs, and what it does to a least-squares solve\n\n"
      "  {:<28} {:>20}  {:>8}  {:>10}  {:>9}\n",
      "switch", "ns a pixel and frame", "x plain", "mean [deg]", "p99 [deg]");
  for (const SimulateSwitch& one : report.switches) {
    text += fmt::format("  {:<28} {:>20.1f}  {:>8.2f}  {:>10.4f}  {:>9.4f}\n", one.name,
                        one.ns_per_pixel, one.times_plain, one.angular_error_deg.mean,
                        one.angular_error_deg.p99);
  }
  return text;
}

std::string SimulateJson(const SimulateBenchReport& report) {
  nlohmann::ordered_json json = {
      {"schema", "sateen.bench.simulate/1"},
      {"size_px", {report.size.width, report.size.height}},
      {"frames", report.frames},
      {"threads", report.threads},
      {"seconds", report.seconds},
      {"peak_memory_gb", report.peak_memory_gb},
      {"steps", nlohmann::ordered_json::array()},
      {"switches", nlohmann::ordered_json::array()},
  };
  for (const SimulateStage& stage : report.stages) {
    json["steps"].push_back(
        {{"step", stage.name}, {"seconds", stage.seconds}, {"ns_per_pixel", stage.ns_per_pixel}});
  }
  for (const SimulateSwitch& one : report.switches) {
    json["switches"].push_back({{"switch", one.name},
                                {"ns_per_pixel", one.ns_per_pixel},
                                {"times_plain", one.times_plain},
                                {"mean_angular_error_deg", one.angular_error_deg.mean},
                                {"p99_angular_error_deg", one.angular_error_deg.p99}});
  }
  return json.dump(2) + "\n";
}

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
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the tables");
  cmd->footer("Frames are written to a folder under $TMPDIR, or /tmp, and removed.");
}

int RunBenchSimulate(const BenchSimulateArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log) {
  const Result<SimulateBenchReport> report =
      SimulateBench(args, task.WithThreads(args.threads)).Run();
  task.ClearProgress();
  if (!report) {
    log << "sateen bench simulate: error: " << report.error().message << '\n';
    return ExitStatus(report.error());
  }
  out << (args.json ? SimulateJson(*report) : SimulateText(*report));
  return 0;
}

}  // namespace sateen::cli
