#include "cli/bench/bench_calibrate.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "cli/bench/peak_memory.h"
#include "core/files/output_folder.h"
#include "core/files/own_folder.h"
#include "core/json.h"
#include "core/parallel.h"
#include "imaging/raw.h"
#include "pipelines/calibrate/calibrate_lights.h"
#include "pipelines/simulate/simulate.h"
#include "pipelines/solve/solve.h"
#include "simulation/rigs.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kFieldMm = 300.0;  // width of the table that the camera sees
constexpr double kRoughMm = 15.0;   // by which the ruler is off, along one axis a light
constexpr int kTilts = 4;
constexpr double kTiltDeg = 10.0;
constexpr const char* kFabric = "fabric";

std::string SheetName(int sheet) { return sheet == 0 ? "flat" : fmt::format("tilt-{}", sheet); }

// A 14-bit camera before `surface`.
json SceneOf(const json& surface, const json& materials, const char* kind, int seed) {
  return {{"schema", "sateen.scene/1"},
          {"rig", "true.json"},
          {"kind", kind},
          {"seed", seed},
          {"surface", surface},
          {"materials", materials},
          {"sensor", {{"preset", "nikon-d5100"}, {"black", 600}, {"full_scale", 1.5}}}};
}

class CalibrateBench {
 public:
  CalibrateBench(const BenchCalibrateArgs& args, const Task& task)
      : args_(args), task_(task), scratch_(MakeScratchFolder("bench-calibrate")) {
    report_.size = {args.width, args.height};
    report_.threads = task.ThreadCount();
  }

  Result<CalibrateBenchReport> Run() {
    const Status status =
        scratch_.map([](const OwnFolder&) {})
            .and_then([&] { return WriteRigs(); })
            .and_then([&] { return SimulateAll(); })
            .and_then([&] { return MeasureRaw(); })
            .and_then([&] { return Calibrate("one flat", 1, "one.json"); })
            .and_then([&] { return Calibrate("flat and 4 tilts", 1 + kTilts, "five.json"); })
            .and_then([&] { return SolveFabric(); })
            .and_then([&] { return MeasureRatios(); });
    if (!status) {
      return tl::unexpected(status.error());
    }
    return std::move(report_);
  }

 private:
  [[nodiscard]] Task Quiet() const { return {.threads = task_.threads, .cancel = task_.cancel}; }
  [[nodiscard]] std::string Path(const std::string& name) const {
    return (scratch_->Path() / name).string();
  }

  Status WriteRigs() {
    rig_ = RingRig(report_.size, LightModel::kNear, kFieldMm);
    report_.lights = static_cast<int>(rig_.lights.size());
    return WriteFileWhole(Path("true.json"), RigToJson(rig_));
  }

  Status SimulateScene(const std::string& name, const json& scene) const {
    if (Status status = WriteFileWhole(Path(name + ".json"), JsonText(scene)); !status) {
      return status;
    }
    const SimulateOptions options{.scene = Path(name + ".json"), .output = Path(name)};
    const Result<SceneFile> done = SimulateSession(options, Quiet());
    task_.Advance();
    return done ? Status() : Status(tl::unexpected(done.error()));
  }

  Status SimulateAll() {
    task_.BeginStage("simulating", 2 + kTilts);
    const json white = {{"surface", {{"albedo", {0.99, 0.99, 0.99}}}}};
    for (int sheet = 0; sheet <= kTilts; ++sheet) {
      const json surface = sheet == 0 ? json{{"shape", "plane"}}
                                      : json{{"shape", "tilted-plane"},
                                             {"slope_deg", kTiltDeg},
                                             {"azimuth_deg", 360.0 * (sheet - 1) / kTilts}};
      if (Status status =
              SimulateScene(SheetName(sheet), SceneOf(surface, white, "sheet", 1 + sheet));
          !status) {
        return status;
      }
    }
    // Denim twill as in samples/scenes: attached shadows, RAW frames with noise.
    Status fabric = SimulateScene(
        kFabric, SceneOf({{"shape", "twill"},
                          {"pitch_mm", 1.6},
                          {"fill", 0.95},
                          {"edge_deg", 40},
                          {"amplitude_mm", 0.12}},
                         {{"warp", {{"albedo", {0.08, 0.14, 0.35}}, {"yarn_variation", 0.1}}},
                          {"weft", {{"albedo", {0.7, 0.68, 0.62}}, {"yarn_variation", 0.05}}}},
                         "fabric", 9));
    if (!fabric) {
      return fabric;
    }
    // The ruler: off along one axis a light, flux as the flat sheet has it in the middle.
    Result<Rig> ruler = ReadRig(Path("flat/rig.json"));
    if (!ruler) {
      return tl::unexpected(ruler.error());
    }
    for (size_t k = 0; k < ruler->lights.size(); ++k) {
      Light& light = ruler->lights[k];
      const Eigen::Vector3d before = IncidentAt(light, Eigen::Vector3d::Zero()).e_rgb *
                                     IncidentAt(light, Eigen::Vector3d::Zero()).l.z();
      light.position_mm[static_cast<Eigen::Index>(k % 3)] += kRoughMm;
      const Incident after = IncidentAt(light, Eigen::Vector3d::Zero());
      light.flux_rgb.array() *= before.array() / (after.e_rgb.array() * after.l.z());
    }
    return WriteFileWhole(Path("ruler.json"), RigToJson(*ruler));
  }

  // Measures LibRaw's decoding alone, which no calibration from these files can beat.
  Status MeasureRaw() {
    std::vector<fs::path> files;
    for (int sheet = 0; sheet <= kTilts; ++sheet) {
      for (const Light& light : rig_.lights) {
        files.emplace_back(Path(SheetName(sheet) + "/frames/" + light.name + ".dng"));
      }
      files.emplace_back(Path(SheetName(sheet) + "/frames/dark.dng"));
    }
    report_.raw_frames = static_cast<int>(files.size());
    std::vector<Status> read(files.size());
    const auto start = std::chrono::steady_clock::now();
    Status ran = ParallelFor(report_.raw_frames, 1, Quiet(), [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const Result<RawMosaic> mosaic = ReadRawMosaic(files[static_cast<size_t>(i)]);
        if (!mosaic) {
          read[static_cast<size_t>(i)] = tl::unexpected(mosaic.error());
        }
      }
    });
    report_.raw_seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    for (const Status& one : read) {
      ran = ran.and_then([&] { return one; });
    }
    return ran;
  }

  Status Calibrate(const std::string& label, int sheets, const std::string& output) {
    task_.BeginStage("calibrating from " + label, 1);
    CalibrateLightsOptions options{.output = Path(output), .rough_rig = Path("ruler.json")};
    for (int sheet = 0; sheet < sheets; ++sheet) {
      options.sheets.emplace_back(Path(SheetName(sheet)));
    }
    ResetPeakMemory();
    const Result<LightsCalibration> done = CalibrateLightsFromSheets(options, Quiet());
    if (!done) {
      return tl::unexpected(done.error());
    }
    CalibrateRow row{.sheets = label, .seconds = done->seconds, .peak_memory_gb = PeakMemoryGb()};
    for (const LightFigures& light : done->lights) {
      row.position_mm = std::max(row.position_mm, light.position_error_mm.value());
      row.direction_deg = std::max(row.direction_deg, light.direction_error_deg.value());
      row.flux = std::max(row.flux, light.flux_error.value());
    }
    row.flat_deg = done->ways.back().flat_deg.value_or(0.0);
    report_.rows.push_back(std::move(row));
    return {};
  }

  Status SolveFabric() {
    task_.BeginStage("solving fabric", 4);
    for (const auto& [label, rig] : {std::pair{"the truth", "flat/rig.json"},
                                     {"flat and 4 tilts", "five.json"},
                                     {"one flat", "one.json"},
                                     {"the ruler", "ruler.json"}}) {
      const SolveOptions options{.capture = Path(kFabric),
                                 .output = Path("maps"),
                                 .rig_file = Path(rig),
                                 .robust = std::nullopt};  // what the lights do, not an estimator
      const Result<SolveOutcome> done = SolveSession(options, Quiet());
      if (!done) {
        return tl::unexpected(done.error());
      }
      const Evaluation& evaluation = done->evaluation;
      report_.fabric.push_back(
          {label, evaluation.low_frequency_error_deg->max, evaluation.angular_error_deg->mean});
      task_.Advance();
    }
    return {};
  }

  Status MeasureRatios() {
    for (const int tilts : {0, kTilts}) {
      task_.BeginStage("random rigs", args_.rigs);
      const Result<ErrorRatios> ratios =
          PredictedErrors({.rigs = args_.rigs, .tilts = tilts}, task_);
      if (!ratios) {
        return tl::unexpected(ratios.error());
      }
      report_.ratios[tilts] = *ratios;
    }
    return {};
  }

  const BenchCalibrateArgs& args_;
  const Task task_;
  const Result<OwnFolder> scratch_;
  Rig rig_;
  CalibrateBenchReport report_;
};

}  // namespace

void AddBenchCalibrate(CLI::App& bench, BenchCalibrateArgs& args) {
  CLI::App* cmd = bench.add_subcommand(
      "calibrate",
      "Lights from one sheet and from five: errors, time, memory; a fabric solved with them; "
      "whether predicted errors are right");
  cmd->add_option("--width", args.width, "Width of the frames [px]")
      ->check(CLI::Range(384, 20000))
      ->capture_default_str();
  cmd->add_option("--height", args.height, "Height of the frames [px]")
      ->check(CLI::Range(256, 20000))
      ->capture_default_str();
  cmd->add_option("--rigs", args.rigs, "Random rigs on which predicted errors are tested")
      ->check(CLI::Range(10, 100000))
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the tables");
  cmd->footer(
      "Six sessions, 2.2 GB at full size, are written to a folder under $TMPDIR, or /tmp, and "
      "removed.");
}

int RunBenchCalibrate(const BenchCalibrateArgs& args, const Task& task, std::ostream& out,
                      std::ostream& log) {
  const Result<CalibrateBenchReport> report =
      CalibrateBench(args, task.WithThreads(args.threads)).Run();
  task.ClearProgress();
  if (!report) {
    log << "sateen bench calibrate: error: " << report.error().message << '\n';
    return ExitStatus(report.error());
  }
  out << (args.json ? JsonReport(*report) : TextReport(*report));
  return 0;
}

}  // namespace sateen::cli
