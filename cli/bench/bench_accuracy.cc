#include "cli/bench/bench_accuracy.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <ostream>
#include <utility>

#include "bench/comparators/comparators.h"
#include "cli/bench/best_seconds.h"
#include "core/angle.h"
#include "core/files/output_folder.h"
#include "core/files/own_folder.h"
#include "pipelines/simulate/scene_file.h"
#include "pipelines/simulate/simulated_session.h"
#include "scanner/sessions/dataset.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/ladder.h"
#include "solver/mosaic/mosaic.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

// Others' estimators take up to 0.2 ms a pixel.
constexpr int64_t kMostPixelsForComparators = 60'000;
// Uncertainties within which at least 95 of 100 errors lie (solver/least_squares/weighted.h).
constexpr float kInterval95 = 1.96F;
constexpr ImageSize kReliefPx = {1280, 960};

struct DataSet {
  std::string name;
  std::string folder;  // below the data folder
  std::vector<int> lights;
  bool exposed = false;  // the 95th percentile of the masked green samples at 0.8 of full scale
};

// The lights are those that docs/accuracy.md names.
std::vector<DataSet> PublicDataSets() {
  const std::vector<int> of_bunny = {2, 3, 4, 18, 20, 23, 24, 26, 34, 36};
  const std::vector<int> every_tenth = {0, 10, 20, 30, 40, 50, 60, 70, 80, 90};
  return {{"shiny bunny, 10 lights, clipped", "bunny/specular", of_bunny, true},
          {"shiny bunny, 10 lights", "bunny/specular", of_bunny},
          {"matte bunny, 10 lights", "bunny/lambert", of_bunny},
          {"DiLiGenT ball, 10 lights", "diligent-ball", every_tenth},
          {"DiLiGenT ball, 96 lights", "diligent-ball", {}}};
}

bool IsInside(const std::optional<Mask>& mask, size_t pixel) {
  return !mask || mask->pixels[pixel] != 0;
}

void Expose(Dataset& capture) {
  std::vector<float> samples;
  for (const LightFrame& frame : capture.stack) {
    for (size_t p = 0; p < frame.rgb[1].pixels.size(); ++p) {
      if (IsInside(capture.mask, p)) {
        samples.push_back(frame.rgb[1].pixels[p]);
      }
    }
  }
  const auto place = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() * 95 / 100);
  std::nth_element(samples.begin(), place, samples.end());
  const float factor = 0.8F / *place;
  for (LightFrame& frame : capture.stack) {
    frame.full_scale = 1.0F;
    for (Image<float>& plane : frame.rgb.planes) {
      for (float& value : plane.pixels) {
        value = std::min(1.0F, factor * value);
      }
    }
  }
}

class AccuracyBench {
 public:
  AccuracyBench(const BenchAccuracyArgs& args, const Task& task) : args_(args), task_(task) {
    report_.threads = task.ThreadCount();
    report_.instruction_set = KernelInstructionSet();
  }

  Result<AccuracyReport> Run() {
    const std::vector<DataSet> sets = PublicDataSets();
    task_.BeginStage("measuring", static_cast<int>(1 + sets.size() + args_.scenes.size()));
    Status status = MeasureRelief();
    for (const DataSet& set : sets) {
      status = status.and_then([&] { return MeasurePublic(set); });
    }
    for (const fs::path& scene : args_.scenes) {
      status = status.and_then([&] { return MeasureScene(scene); });
    }
    return status ? Result<AccuracyReport>(std::move(report_)) : tl::unexpected(status.error());
  }

 private:
  [[nodiscard]] Task Quiet(int threads) const {
    return {.threads = threads, .cancel = task_.cancel};
  }

  // A Lambertian surface under near lights: what the ladder may cost where it is not needed.
  Status MeasureRelief() {
    Dataset capture{.rig = RingRig(kReliefPx)};
    Result<RenderedRelief> rendered = RenderRelief({.shape = ReliefShape::kRipple,
                                                    .max_slope_rad = 30.0 * kRadPerDeg,
                                                    .sensor = SensorModel{}},
                                                   capture.rig, kReliefPx, Quiet(0));
    if (!rendered) {
      return tl::unexpected(rendered.error());
    }
    capture.stack = std::move(rendered->stack);
    capture.truth =
        Truth{.normal = std::move(rendered->normal), .albedo = std::move(rendered->albedo)};
    return MeasureColours("Lambertian relief", capture);
  }

  Status MeasurePublic(const DataSet& set) {
    Result<Dataset> capture =
        args_.data.empty() ? Fail(ErrorCode::kIo, "no --data and no SATEEN_DATA")
                           : ReadDataset(args_.data / set.folder, {.lights = set.lights}, Quiet(0));
    if (!capture || !capture->truth) {
      report_.skipped.push_back(
          fmt::format("{}: {}", set.name, capture ? "it has no truth" : capture.error().message));
      task_.Advance();
      return task_.CheckCancelled();
    }
    if (set.exposed) {
      Expose(*capture);
    }
    return MeasureColours(set.name, *capture);
  }

  Status MeasureScene(const fs::path& file) {
    const Result<SceneFile> scene = ReadSceneFile(file);
    if (!scene) {
      return tl::unexpected(scene.error());
    }
    const Result<OwnFolder> scratch = MakeScratchFolder("bench-accuracy");
    Result<OutputFolder> folder =
        scratch ? OutputFolder::Open(scratch->Path()) : tl::unexpected(scratch.error());
    Status status =
        folder
            ? StageSimulatedSession(*scene, FrameFormat::kRawDng, Quiet(0), *folder).and_then([&] {
                return folder->Commit();
              })
            : tl::unexpected(folder.error());
    if (!status) {
      return status;
    }
    const std::string name = file.stem().string();
    const auto read = [&](Domain domain) {
      return ReadDataset(scratch->Path(), {.domain = domain, .scratch_dir = scratch->Path()},
                         Quiet(0));
    };
    const Result<Dataset> colours = read(Domain::kRgb);
    if (!colours) {
      return tl::unexpected(colours.error());
    }
    status = MeasureColours(name, *colours);
    const Result<Dataset> mosaics = status ? read(Domain::kAuto) : tl::unexpected(status.error());
    if (!mosaics) {
      return tl::unexpected(mosaics.error());
    }
    return mosaics->mosaics ? MeasureMosaics(name, *mosaics) : Status();
  }

  Status MeasureColours(const std::string& name, const Dataset& capture) {
    Status status;
    if (PixelsOf(capture) <= kMostPixelsForComparators) {
      for (const Comparator comparator : ComparatorsFor(capture.rig)) {
        status = status.and_then([&] {
          return Measure(name, std::string(Name(comparator)), capture, false, [&](const Task&) {
            field_ = SolveBy(comparator, capture.stack, capture.rig, capture.mask);
            return Status();
          });
        });
      }
    }
    status = status.and_then([&] {
      return Measure(name, "least squares", capture, true, [&](const Task& task) {
        return SolveLambertianInto(capture.stack, capture.rig, capture.mask, {}, task, field_);
      });
    });
    const LadderOptions ladder{.noise = NoiseOf(capture.stack, capture.rig)};
    status = status.and_then([&] {
      return Measure(name, "ladder", capture, true, [&](const Task& task) {
        return SolveLadderInto(capture.stack, capture.rig, capture.mask, ladder, task, field_);
      });
    });
    task_.Advance();
    return status.and_then([&] { return task_.CheckCancelled(); });
  }

  Status MeasureMosaics(const std::string& name, const Dataset& capture) {
    const auto measure = [&](const char* method, const MosaicOptions& options) {
      return Measure(name, method, capture, true, [&](const Task& task) {
        return SolveMosaicInto(capture.mosaics->stack, capture.rig, capture.mask, options, task,
                               field_);
      });
    };
    return measure("least squares, mosaics", {.mode = std::nullopt}).and_then([&] {
      return measure("ladder, mosaics", {});
    });
  }

  static int64_t PixelsOf(const Dataset& capture) {
    const auto all = static_cast<int64_t>(capture.Size().PixelCount());
    return capture.mask ? all - std::ranges::count(capture.mask->pixels, uint8_t{0}) : all;
  }

  // Slow methods run once, ours as often as asked, on one thread and on all.
  Status Measure(const std::string& data, std::string method, const Dataset& capture, bool is_ours,
                 const std::function<Status(const Task&)>& solve) {
    const auto pixels = static_cast<double>(PixelsOf(capture));
    const Result<double> one =
        BestSeconds(is_ours ? args_.repeats : 1, [&] { return solve(Quiet(1)); });
    const Result<double> all =
        is_ours && one ? BestSeconds(args_.repeats, [&] { return solve(Quiet(report_.threads)); })
                       : one;
    if (!all) {
      return tl::unexpected(all.error());
    }
    AccuracyRow row{.data = data,
                    .method = std::move(method),
                    .pixels = PixelsOf(capture),
                    .ns_per_pixel = 1e9 * *one / pixels,
                    .megapixels_per_s = is_ours ? 1e-6 * pixels / *all : 0.0};
    Image<float> error_deg;
    const Result<ErrorStatistics> error =
        AngularErrorDeg(field_, capture.truth->normal, &error_deg);
    if (!error) {
      return tl::unexpected(error.error());
    }
    row.angular_error_deg = *error;
    if (!field_.uncertainty.pixels.empty()) {
      Compare(error_deg, field_.uncertainty, capture, row.standardised_error, row.coverage);
    }
    if (Status status = MeasureAlbedo(capture, row); !status) {
      return status;
    }
    report_.rows.push_back(std::move(row));
    return task_.CheckCancelled();
  }

  Status MeasureAlbedo(const Dataset& capture, AccuracyRow& row) const {
    if (!capture.truth->albedo) {
      return {};
    }
    const Result<ErrorStatistics> mean = RelativeAlbedoError(field_, *capture.truth->albedo);
    const Result<Image<float>> error = AlbedoErrorMap(
        field_, *capture.truth->albedo, capture.mosaics ? &capture.mosaics->stack.cfa : nullptr);
    if (!mean || !error) {
      return tl::unexpected(!mean ? mean.error() : error.error());
    }
    row.albedo_error = mean->mean;
    if (!field_.albedo_uncertainty.pixels.empty()) {
      Compare(*error, field_.albedo_uncertainty, capture, row.albedo_standardised_error,
              row.albedo_coverage);
    }
    return {};
  }

  // Root mean square of error over uncertainty, and the share of errors inside the interval.
  void Compare(const Image<float>& errors, const Image<float>& uncertainties,
               const Dataset& capture, double& standardised, double& coverage) const {
    double squares = 0.0;
    int64_t inside = 0;
    int64_t count = 0;
    for (size_t p = 0; p < errors.pixels.size(); ++p) {
      if (!IsSolved(field_, p) || !IsInside(capture.mask, p) ||
          capture.truth->normal[2].pixels[p] == 0.0F) {
        continue;
      }
      const float ratio = errors.pixels[p] / std::max(uncertainties.pixels[p], 1e-9F);
      squares += static_cast<double>(ratio) * static_cast<double>(ratio);
      inside += ratio <= kInterval95 ? 1 : 0;
      ++count;
    }
    standardised = std::sqrt(squares / static_cast<double>(std::max<int64_t>(count, 1)));
    coverage = static_cast<double>(inside) / static_cast<double>(std::max<int64_t>(count, 1));
  }

  const BenchAccuracyArgs& args_;
  const Task task_;
  NormalField field_;  // reused, so that no run pays for fresh memory
  AccuracyReport report_;
};

Status WriteFiles(const BenchAccuracyArgs& args, const AccuracyReport& report) {
  Status status = args.plot.empty() ? Status() : WriteFileWhole(args.plot, SvgPlot(report));
  if (status && !args.markdown.empty()) {
    const std::string plot =
        args.plot.empty() ? ""
                          : fs::absolute(args.plot)
                                .lexically_relative(fs::absolute(args.markdown).parent_path())
                                .generic_string();
    status = WriteFileWhole(args.markdown, MarkdownReport(report, plot));
  }
  return status;
}

}  // namespace

void AddBenchAccuracy(CLI::App& bench, BenchAccuracyArgs& args) {
  CLI::App* cmd = bench.add_subcommand(
      "accuracy",
      "Run every method on every data set found: time, error against truth, and whether the "
      "predicted uncertainty holds; beside plain re-implementations of others' methods");
  cmd->add_option("--data", args.data, "Folder with the public data sets bunny and diligent-ball")
      ->check(CLI::ExistingDirectory)
      ->envname("SATEEN_DATA");
  cmd->add_option(
         "--scene", args.scenes,
         "Scene file to render as camera RAW and solve, from colours and from mosaics; may "
         "be given again")
      ->check(CLI::ExistingFile);
  cmd->add_option("--repeats", args.repeats, "Runs of our methods; the fastest counts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads to compare with one; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_option("--plot", args.plot, "Also write speed against error as an SVG file");
  cmd->add_option("--markdown", args.markdown, "Also write the page docs/accuracy.md");
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the table");
}

int RunBenchAccuracy(const BenchAccuracyArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log) {
  const Result<AccuracyReport> report = AccuracyBench(args, task.WithThreads(args.threads)).Run();
  task.ClearProgress();
  const Status status = report ? WriteFiles(args, *report) : Status(tl::unexpected(report.error()));
  if (!status) {
    log << "sateen bench accuracy: error: " << status.error().message << '\n';
    return ExitStatus(status.error());
  }
  out << (args.json ? JsonReport(*report) : TextReport(*report)) << '\n';
  return 0;
}

}  // namespace sateen::cli
