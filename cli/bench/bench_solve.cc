#include "cli/bench/bench_solve.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <ostream>
#include <utility>

#include "bench/memory_floor/memory_floor.h"
#include "cli/bench/bench_report.h"
#include "cli/bench/best_seconds.h"
#include "core/angle.h"
#include "core/files/output_folder.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/lambertian.h"

namespace sateen::cli {
namespace {

constexpr int kReferenceRepeats = 2;  // a hundred times as slow, and as steady
constexpr float kSubnormal = 1e-40F;
constexpr std::array kBackends = {Backend::kJacobiSvd, Backend::kQr, Backend::kLdlt, Backend::kFast,
                                  Backend::kAuto};

struct BenchCase {
  std::string name;
  Rig rig;
  RenderedRelief rendered;
};

// Renders the cases, each under ten near lights unless its name says otherwise:
//
//     clean, led, led+field   exact radiance
//     noisy                   a 14-bit sensor
//     hard                    the same, slopes to 75 degrees, saturated highlights, and lights within
//                             20 degrees around the zenith
//     subnormal               clean at 1e-40 of its radiance
Result<std::vector<BenchCase>> RenderCases(ImageSize size, const Task& task) {
  const Rig rig = RingRig(size);
  Rig huddled = rig;
  huddled.lights = LedRing(LightModel::kNear, 10, 20.0 * kRadPerDeg, 600.0);
  for (Light& light : huddled.lights) {
    light.flux_rgb.setConstant(0.36);
  }
  const ReliefScene clean{.shape = ReliefShape::kRipple, .max_slope_rad = 30.0 * kRadPerDeg};
  ReliefScene noisy = clean;
  noisy.sensor = SensorModel{};
  ReliefScene hard = noisy;
  hard.max_slope_rad = 75.0 * kRadPerDeg;
  hard.sensor->full_scale = 0.6;
  std::vector<BenchCase> cases = {{"clean", rig, {}},
                                  {"noisy", rig, {}},
                                  {"hard", std::move(huddled), {}},
                                  {"led", RingRig(size, LightModel::kLed), {}},
                                  {"led+field", RingRig(size, LightModel::kLedField), {}}};
  const std::array scenes = {clean, noisy, hard, clean, clean};
  for (size_t i = 0; i < cases.size(); ++i) {
    Result<RenderedRelief> rendered = RenderRelief(scenes[i], cases[i].rig, size, task);
    if (!rendered) {
      return tl::unexpected(rendered.error());
    }
    cases[i].rendered = std::move(*rendered);
  }
  cases.push_back({"subnormal", rig, cases[0].rendered});
  for (LightFrame& frame : cases.back().rendered.stack) {
    for (Image<float>& plane : frame.rgb.planes) {
      std::transform(plane.pixels.begin(), plane.pixels.end(), plane.pixels.begin(),
                     [](float value) { return value * kSubnormal; });
    }
  }
  for (Image<float>& plane : cases.back().rendered.albedo.planes) {
    std::transform(plane.pixels.begin(), plane.pixels.end(), plane.pixels.begin(),
                   [](float value) { return value * kSubnormal; });
  }
  return cases;
}

class Bench {
 public:
  Bench(const BenchSolveArgs& args, const Task& task) : args_(args), task_(task) {
    report_.size = {args.width, args.height};
    report_.instruction_set = KernelInstructionSet();
    thread_counts_ = {1};
    if (task.ThreadCount() > 1) {
      thread_counts_.push_back(task.ThreadCount());
    }
  }

  Result<BenchReport> Run() {
    const Result<std::vector<BenchCase>> cases = RenderCases(report_.size, task_);
    if (!cases) {
      return tl::unexpected(cases.error());
    }
    report_.lights = static_cast<int>(cases->front().rig.lights.size());
    task_.BeginStage("measuring",
                     static_cast<int>(thread_counts_.size() * cases->size() * kBackends.size()));
    for (const int threads : thread_counts_) {
      Status status = MeasureFloor(cases->front(), threads);
      for (const BenchCase& bench_case : *cases) {
        for (const Backend backend : kBackends) {
          if (status) {
            status = MeasureBackend(bench_case, backend, threads);
          }
        }
      }
      if (!status) {
        return tl::unexpected(status.error());
      }
    }
    return report_;
  }

 private:
  [[nodiscard]] double NsPerPixel(double seconds) const {
    return 1e9 * seconds / static_cast<double>(report_.size.PixelCount());
  }

  [[nodiscard]] Task Quiet(int threads) const {
    return {.threads = threads, .cancel = task_.cancel};
  }

  Status MeasureFloor(const BenchCase& bench_case, int threads) {
    const Result<double> seconds = BestSeconds(args_.repeats, [&] {
      return TouchAllRows(bench_case.rendered.stack, Quiet(threads), field_);
    });
    if (!seconds) {
      return tl::unexpected(seconds.error());
    }
    const double ns = NsPerPixel(*seconds);
    const size_t bytes = BytesPerPixel(bench_case.rig.lights.size());
    report_.floors.push_back({threads, ns, static_cast<double>(bytes) / ns});
    return {};
  }

  Status MeasureBackend(const BenchCase& bench_case, Backend backend, int threads) {
    const bool vectorised = backend == Backend::kFast || backend == Backend::kAuto;
    const int repeats = vectorised ? args_.repeats : std::min(args_.repeats, kReferenceRepeats);
    const LambertianOptions options{.backend = backend};
    const Result<double> seconds = BestSeconds(repeats, [&] {
      return SolveLambertianInto(bench_case.rendered.stack, bench_case.rig, std::nullopt, options,
                                 Quiet(threads), field_);
    });
    if (!seconds) {
      return tl::unexpected(seconds.error());
    }
    BenchRow row{.backend = backend, .case_name = bench_case.name, .threads = threads};
    row.ns_per_pixel = NsPerPixel(*seconds);
    row.times_floor = row.ns_per_pixel / report_.floors.back().ns_per_pixel;
    row.times_jacobi_svd = JacobiNs(row) / row.ns_per_pixel;
    row.solved_fraction =
        static_cast<double>(field_.summary.solved) / static_cast<double>(field_.summary.pixels);
    row.angular_error_deg = *AngularErrorDeg(field_, bench_case.rendered.normal);
    row.albedo_error = RelativeAlbedoError(field_, bench_case.rendered.albedo)->mean;
    report_.rows.push_back(row);
    task_.Advance();
    return task_.CheckCancelled();
  }

  // Time of the reference on the same case and threads; it is the first to be measured.
  [[nodiscard]] double JacobiNs(const BenchRow& row) const {
    for (const BenchRow& other : report_.rows) {
      if (other.backend == Backend::kJacobiSvd && other.case_name == row.case_name &&
          other.threads == row.threads) {
        return other.ns_per_pixel;
      }
    }
    return row.ns_per_pixel;
  }

  const BenchSolveArgs& args_;
  const Task task_;
  std::vector<int> thread_counts_;
  NormalField field_;  // reused, so that no run pays for fresh memory
  BenchReport report_;
};

}  // namespace

void AddBenchSolve(CLI::App& bench, BenchSolveArgs& args) {
  CLI::App* cmd = bench.add_subcommand(
      "solve",
      "Each solver backend on ten near lights: time, distance from memory bandwidth, and error");
  cmd->add_option("--width", args.width, "Image width [px]; the default outgrows usual caches")
      ->check(CLI::Range(16, 20000))
      ->capture_default_str();
  cmd->add_option("--height", args.height, "Image height [px]")
      ->check(CLI::Range(16, 20000))
      ->capture_default_str();
  cmd->add_option("--repeats", args.repeats, "Runs of the fast backends; the fastest counts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads to compare with one; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_option("--plot", args.plot, "Also write speed against error as an SVG file");
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the table");
}

int RunBenchSolve(const BenchSolveArgs& args, const Task& task, std::ostream& out,
                  std::ostream& log) {
  const Result<BenchReport> report = Bench(args, task.WithThreads(args.threads)).Run();
  task.ClearProgress();
  Status status;
  if (report) {
    out << (args.json ? JsonReport(*report) : TextReport(*report)) << '\n';
    status = args.plot.empty() ? Status() : WriteFileWhole(args.plot, SvgPlot(*report));
  } else {
    status = tl::unexpected(report.error());
  }
  if (!status) {
    log << "sateen bench solve: error: " << status.error().message << '\n';
    return ExitStatus(status.error());
  }
  return 0;
}

}  // namespace sateen::cli
