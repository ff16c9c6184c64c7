#include "cli/solve.h"

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <ostream>
#include <utility>

#include "cli/solve_report.h"
#include "core/output_folder.h"
#include "imaging/encoding_name.h"
#include "imaging/image_io.h"
#include "pipelines/solve/maps.h"
#include "pipelines/solve/mosaic_maps.h"
#include "solver/height.h"
#include "solver/ladder.h"
#include "solver/least_squares/fast_rows.h"
#include "solver/mosaic/mosaic.h"
#include "solver/undistort.h"

namespace sateen::cli {
namespace {

constexpr double kMostHeight = 0.25;  // of the lowest light's: no cloth is thicker

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Mosaics have two backends; the others are there to be compared with.
bool HasMosaics(const SolveArgs& args) {
  const std::optional<Backend> backend = BackendNamed(args.backend);
  return backend != Backend::kQr && backend != Backend::kLdlt;
}

Domain DomainNamed(const SolveArgs& args) {
  if (args.domain == "raw") {
    return Domain::kRaw;
  }
  return args.domain == "rgb" || !HasMosaics(args) ? Domain::kRgb : Domain::kAuto;
}

ReadDatasetOptions ReadOptionsOf(const SolveArgs& args) {
  ReadDatasetOptions options = args.read;
  options.domain = DomainNamed(args);
  options.by_noise = LadderModeNamed(args.robust).has_value();
  options.scratch_dir = args.output;
  options.encoding = *EncodingNamed(args.encoding);
  if (!args.rig_file.empty()) {
    options.rig_file = args.rig_file;
  }
  if (!args.mask_file.empty()) {
    options.mask_file = args.mask_file;
  }
  if (!args.truth_dir.empty()) {
    options.truth_dir = args.truth_dir;
  }
  return options;
}

// From pixel to pixel on the table, in the middle of the picture. [mm]
std::optional<double> PitchOnTable(const Rig& rig) {
  if (!rig.camera) {
    return std::nullopt;
  }
  const auto seen = [&](double right, double down) {
    return TablePointOfPixel(*rig.camera, 0.5 * rig.camera->size_px.width + right,
                             0.5 * rig.camera->size_px.height + down);
  };
  const std::optional<Eigen::Vector3d> middle = seen(0.0, 0.0);
  const std::optional<Eigen::Vector3d> right = seen(1.0, 0.0);
  const std::optional<Eigen::Vector3d> down = seen(0.0, 1.0);
  if (!middle || !right || !down) {
    return std::nullopt;
  }
  const double area = (*right - *middle).cross(*down - *middle).norm();
  return area > 0.0 ? std::optional(std::sqrt(area)) : std::nullopt;
}

// Compares with truth where there is any; `error_map_deg` receives the angles.
Status Evaluate(SolveOutcome& outcome, std::optional<Image<float>>& error_map_deg) {
  const std::optional<Truth>& truth = outcome.capture.truth;
  if (!truth) {
    return {};
  }
  Image<float> map;
  const Result<ErrorStatistics> angle = AngularErrorDeg(outcome.field, truth->normal, &map);
  if (!angle) {
    return tl::unexpected(angle.error());
  }
  if (angle->count == 0) {
    return {};
  }
  outcome.angular_error_deg = *angle;
  error_map_deg = std::move(map);
  if (const std::optional<double> pitch_mm = PitchOnTable(outcome.capture.rig)) {
    const Result<ErrorStatistics> slow =
        LowFrequencyErrorDeg(outcome.field, truth->normal, *pitch_mm);
    if (slow && slow->count > 0) {
      outcome.low_frequency_error_deg = *slow;
    }
  }
  if (truth->albedo) {
    const Result<ErrorStatistics> albedo = RelativeAlbedoError(outcome.field, *truth->albedo);
    if (!albedo) {
      return tl::unexpected(albedo.error());
    }
    outcome.albedo_error = *albedo;
  }
  return {};
}

// CLI11's own ranges let "nan" pass.
std::string FaultOfAngle(const std::string& text) {
  double angle_deg = 0.0;
  const bool is_angle =
      CLI::detail::lexical_cast(text, angle_deg) && angle_deg > 0.0 && angle_deg <= 180.0;
  return is_angle ? "" : fmt::format("{} is not an angle in (0, 180] degrees", text);
}

std::string WhyNotPassed(const SolveArgs& args, const SolveOutcome& outcome) {
  if (!outcome.angular_error_deg) {
    return fmt::format("no solved pixel has truth to compare with for --fail-above {}",
                       *args.fail_above_deg);
  }
  return fmt::format("mean angular error {:.4g} deg is above --fail-above {}",
                     outcome.angular_error_deg->mean, *args.fail_above_deg);
}

// What the formats can say and this solver does not do, or must not.
// Of those that have a place; infinite where none has.
double LowestLightMm(const Rig& rig) {
  double lowest_mm = std::numeric_limits<double>::infinity();
  for (const Light& light : rig.lights) {
    if (light.model != LightModel::kDistant) {
      lowest_mm = std::min(lowest_mm, light.position_mm.z());
    }
  }
  return lowest_mm;
}

Status CheckSupported(const SolveArgs& args, Dataset& capture) {
  if (capture.session && capture.session->table_from_sheet) {
    return Fail(ErrorCode::kBadData,
                "{}: the session has table_from_sheet, but solving a tilted sheet is not supported "
                "yet; remove the key if the sheet lay on the table",
                args.capture.string());
  }
  if (args.fail_above_deg && !capture.truth) {
    return Fail(ErrorCode::kBadData,
                "{}: the capture has no truth; --fail-above needs truth/normal.exr, normal_gt.exr "
                "or Normal_gt.mat, or --truth",
                args.capture.string());
  }
  if (args.domain == "raw" && !HasMosaics(args)) {
    return Fail(ErrorCode::kInvalidArgument,
                "--backend {} is for interpolated colours; use --domain rgb, or --backend auto, "
                "fast or jacobi-svd",
                args.backend);
  }
  if (args.undistort && !capture.rig.camera) {
    return Fail(ErrorCode::kBadData,
                "{}: --undistort needs the lens, and the rig has no camera; run sateen calibrate "
                "lens, or name a rig that has one with --rig",
                args.capture.string());
  }
  if ((args.relief || args.height_mm != 0.0) && AllDistant(capture.rig.lights)) {
    return Fail(ErrorCode::kBadData,
                "{}: all {} lights are distant, and their light is the same at every height; {} "
                "needs lights with a place: near, led or led+field, and a calibrated camera",
                args.capture.string(), capture.rig.lights.size(),
                args.relief ? "--relief" : "--height");
  }
  const double lowest_mm = LowestLightMm(capture.rig);
  if (!(std::abs(args.height_mm) <= kMostHeight * lowest_mm)) {
    return Fail(ErrorCode::kInvalidArgument,
                "--height {:g}: the lowest light hangs {:.4g} mm above the table; need a surface "
                "within a quarter of that, from {:.4g} to {:.4g} mm",
                args.height_mm, lowest_mm, -kMostHeight * lowest_mm, kMostHeight * lowest_mm);
  }
  std::error_code ignored;  // a folder that does not exist yet is no other folder
  if (std::filesystem::equivalent(args.capture, args.output, ignored)) {
    return Fail(ErrorCode::kInvalidArgument,
                "{}: is the capture itself; give a folder of its own for the maps",
                args.output.string());
  }
  return {};
}

// What becomes maps; `outcome` stays in the camera's own pixels.
struct MapsToWrite {
  NormalField field;
  LightFrame first_frame;  // in the overview
  std::optional<Image<float>> error_deg;
};

// Takes the lens's distortion out of everything that becomes a map.
Status UndistortMaps(const Camera& camera, const Task& task, MapsToWrite& maps) {
  Result<NormalField> field = Undistorted(maps.field, camera, task);
  if (!field) {
    return tl::unexpected(field.error());
  }
  maps.field = *std::move(field);
  std::vector<Image<float>*> planes;
  for (Image<float>& plane : maps.first_frame.rgb.planes) {
    planes.push_back(&plane);
  }
  if (maps.error_deg) {
    planes.push_back(&*maps.error_deg);
  }
  for (Image<float>* plane : planes) {
    Result<Image<float>> undistorted = Undistorted(*plane, camera, task);
    if (!undistorted) {
      return tl::unexpected(undistorted.error());
    }
    *plane = *std::move(undistorted);
  }
  return {};
}

Status StageAll(const SolveArgs& args, const SolveOutcome& outcome,
                const std::optional<Image<float>>& error_deg, const Task& task,
                OutputFolder& folder) {
  const MapsOptions options{.normal_y_down = args.normal_y == "down"};
  const LightFrame first = outcome.capture.mosaics ? ShowFrame(outcome.capture.mosaics->stack, 0)
                                                   : outcome.capture.stack.front();
  if (!args.undistort) {
    return StageMaps(outcome.field, first, error_deg, options, folder);
  }
  MapsToWrite maps{outcome.field, first, error_deg};
  return UndistortMaps(*outcome.capture.rig.camera, task, maps).and_then([&] {
    return StageMaps(maps.field, maps.first_frame, maps.error_deg, options, folder);
  });
}

// height.exr; nothing without --relief.
Status StageHeight(const SolveArgs& args, const SolveOutcome& outcome, const Task& task,
                   OutputFolder& folder) {
  if (!outcome.relief) {
    folder.Retire("height.exr");
    return {};
  }
  if (!args.undistort) {
    return WriteExr(folder.Stage("height.exr"), outcome.relief->height_mm);
  }
  return Undistorted(outcome.relief->height_mm, *outcome.capture.rig.camera, task)
      .and_then([&](const Image<float>& straight) {
        return WriteExr(folder.Stage("height.exr"), straight);
      });
}

Result<NormalField> SolveStack(const SolveArgs& args, const LambertianOptions& least_squares,
                               const Dataset& capture, const Task& task) {
  const std::optional<LadderMode> mode = LadderModeNamed(args.robust);
  if (capture.mosaics) {
    return SolveMosaic(capture.mosaics->stack, capture.rig, capture.mask,
                       {.mode = mode, .least_squares = least_squares}, task);
  }
  if (!mode) {
    return SolveLambertian(capture.stack, capture.rig, capture.mask, least_squares, task);
  }
  return SolveLadder(
      capture.stack, capture.rig, capture.mask,
      {.mode = *mode, .least_squares = least_squares, .noise = NoiseOf(capture.stack, capture.rig)},
      task);
}

// Maps that need no other row of themselves than the one that is written.
bool CanStream(const SolveArgs& args, const Dataset& capture) {
  return capture.mosaics && !capture.truth && !args.undistort && !args.relief;
}

Status SolveByBands(const SolveArgs& args, const LambertianOptions& least_squares, const Task& task,
                    OutputFolder& folder, SolveOutcome& outcome) {
  const Dataset& capture = outcome.capture;
  return SolveIntoMaps(capture.mosaics->stack, capture.rig, capture.mask,
                       {.mode = LadderModeNamed(args.robust), .least_squares = least_squares},
                       {.normal_y_down = args.normal_y == "down"}, task, folder)
      .map([&](const SolveSummary& summary) { outcome.field.summary = summary; });
}

// Solves once more, with the point of each pixel at the height that the normals give it.
Status SolveAtHeights(const SolveArgs& args, const LambertianOptions& least_squares,
                      const Task& task, SolveOutcome& outcome) {
  const Clock::time_point start = Clock::now();
  Result<Image<float>> height_mm =
      IntegrateNormals(outcome.field, *outcome.capture.rig.camera, task);
  if (!height_mm) {
    return tl::unexpected(height_mm.error());
  }
  ReliefOutcome relief{.seconds = SecondsSince(start)};
  LambertianOptions at_heights = least_squares;
  at_heights.height_mm = &*height_mm;
  Result<NormalField> again = SolveStack(args, at_heights, outcome.capture, task);
  if (!again) {
    return tl::unexpected(again.error());
  }
  const Result<ErrorStatistics> turned = AngularErrorDeg(*again, outcome.field.normal);
  if (!turned) {
    return tl::unexpected(turned.error());
  }
  relief.turned_deg = *turned;
  relief.lowest_mm = std::numeric_limits<double>::infinity();
  relief.highest_mm = -relief.lowest_mm;
  for (size_t p = 0; p < height_mm->pixels.size(); ++p) {
    height_mm->pixels[p] += static_cast<float>(args.height_mm);
    if (IsSolved(*again, p)) {
      relief.lowest_mm = std::min(relief.lowest_mm, static_cast<double>(height_mm->pixels[p]));
      relief.highest_mm = std::max(relief.highest_mm, static_cast<double>(height_mm->pixels[p]));
    }
  }
  relief.height_mm = *std::move(height_mm);
  outcome.relief = std::move(relief);
  outcome.field = *std::move(again);
  return {};
}

Status SolveWhole(const SolveArgs& args, const LambertianOptions& least_squares, const Task& task,
                  OutputFolder& folder, SolveOutcome& outcome) {
  Result<NormalField> field = SolveStack(args, least_squares, outcome.capture, task);
  if (!field) {
    return tl::unexpected(field.error());
  }
  outcome.field = std::move(*field);
  std::optional<Image<float>> error_map_deg;
  const Status solved = args.relief ? SolveAtHeights(args, least_squares, task, outcome) : Status();
  return solved.and_then([&] { return Evaluate(outcome, error_map_deg); }).and_then([&] {
    return StageAll(args, outcome, error_map_deg, task, folder);
  });
}

// Reads, solves, compares and writes. Nothing is left behind where any of it fails.
Result<SolveOutcome> SolveCapture(const SolveArgs& args, const Task& task, std::ostream& log) {
  const Clock::time_point start = Clock::now();
  LambertianOptions options = args.solver;
  options.backend = *BackendNamed(args.backend);
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  // Before the work, so that a folder that cannot be written to is told at once.
  Result<OutputFolder> folder = OutputFolder::Open(args.output);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  Result<Dataset> capture = ReadDataset(args.capture, ReadOptionsOf(args), task);
  if (!capture) {
    return tl::unexpected(capture.error());
  }
  if (Status status = CheckSupported(args, *capture); !status) {
    return tl::unexpected(status.error());
  }
  if (args.height_mm != 0.0) {
    Result<Rig> lifted = Lifted(std::move(capture->rig), args.height_mm);
    if (!lifted) {
      return tl::unexpected(lifted.error());
    }
    capture->rig = *std::move(lifted);
  }
  task.ClearProgress();
  for (const std::string& warning : capture->warnings) {
    log << "sateen solve: warning: " << warning << '\n';
  }
  SolveOutcome outcome;
  outcome.capture = std::move(*capture);
  outcome.seconds_reading = SecondsSince(start);
  Status status = CanStream(args, outcome.capture)
                      ? SolveByBands(args, options, task, *folder, outcome)
                      : SolveWhole(args, options, task, *folder, outcome);
  if (status) {
    status = StageHeight(args, outcome, task, *folder);
  }
  if (status) {
    status = task.CheckCancelled();
  }
  outcome.seconds_total = SecondsSince(start);
  if (status) {
    status = folder->WriteText("solve.json", JsonReport(args, outcome) + "\n");
  }
  if (status) {
    status = folder->Commit();
  }
  if (!status) {
    return tl::unexpected(folder->InPlace(status.error()));
  }
  return outcome;
}

}  // namespace

bool Passed(const SolveArgs& args, const SolveOutcome& outcome) {
  // Not "above", so that NaN does not pass.
  return !args.fail_above_deg || (outcome.angular_error_deg.has_value() &&
                                  outcome.angular_error_deg->mean <= *args.fail_above_deg);
}

void AddSolve(CLI::App& root, SolveArgs& args) {
  CLI::App* cmd =
      root.add_subcommand("solve", "Solve surface normal and albedo for every pixel of a capture");
  cmd->add_option(
         "capture", args.capture,
         "A session folder (session.json), a DiLiGenT folder, an RTI .lp file, a folder of images "
         "with a lights.txt in it or one folder up, or with --rig a folder of images alone")
      ->required();
  cmd->add_option("-o,--output", args.output, "Folder for the maps; made where missing")
      ->required();
  cmd->add_option("--rig", args.rig_file, "rig.json to use instead of the capture's own lights");
  cmd->add_option("--mask", args.mask_file,
                  "Image that is white where to solve, instead of the capture's own mask");
  cmd->add_option(
      "--truth", args.truth_dir,
      "Simulated session whose truth this capture is compared with: DIR/truth/normal.exr "
      "and albedo.exr");
  cmd->add_option("--lights", args.read.lights, "Use only these lights, by index: 0,10,20")
      ->delimiter(',')
      ->allow_extra_args(false);  // or it would take the capture for a light
  cmd->add_option("--backend", args.backend,
                  "How the least squares are solved; auto is fast, and the reference (jacobi-svd) "
                  "where fast is not exact enough")
      ->check(CLI::IsMember({"auto", "fast", "jacobi-svd", "qr", "ldlt"}))
      ->capture_default_str();
  cmd->add_option(
         "--robust", args.robust,
         "What to do about samples off the Lambertian model. auto: each pixel takes the "
         "lowest rung that explains it; least-squares, robust: that rung everywhere; none: "
         "least squares without weights and without uncertainty")
      ->check(CLI::IsMember({"auto", "least-squares", "robust", "none"}))
      ->capture_default_str();
  cmd->add_option(
         "--domain", args.domain,
         "What is solved. raw: each site of the mosaic from readings of its own colour; rgb: "
         "colours interpolated at every pixel; auto: raw where all frames are camera RAW, one "
         "exposure a light and not moved")
      ->check(CLI::IsMember({"auto", "raw", "rgb"}))
      ->capture_default_str();
  cmd->add_option("--shadow-level", args.solver.shadow_level,
                  "Leave out samples at or below this fraction of the pixel's brightest [0, 1)")
      ->capture_default_str();
  cmd->add_option("--clip-level", args.solver.clip_level,
                  "Leave out samples at or above this fraction of full scale (0, 1]")
      ->capture_default_str();
  cmd->add_option("--dark-level", args.solver.dark_level,
                  "Pixels with no sample above this fraction of full scale are dark [0, 1)")
      ->capture_default_str();
  cmd->add_option("--max-condition", args.solver.max_condition,
                  "Pixels whose usable lights have a larger condition number are not solved "
                  "[2, 1e6]")
      ->capture_default_str();
  cmd->add_option("--normal-y", args.normal_y,
                  "Normal maps with y up (OpenGL, glTF) or down (DirectX)")
      ->check(CLI::IsMember({"up", "down"}))
      ->capture_default_str();
  cmd->add_flag("--undistort", args.undistort,
                "Write the maps as a camera without the lens's distortion would have them");
  cmd->add_option("--encoding", args.encoding,
                  "What integer files hold; auto: 8 bits are sRGB, 16 bits are linear")
      ->check(CLI::IsMember({"auto", "linear", "srgb"}))
      ->capture_default_str();
  cmd->add_option("--height", args.height_mm,
                  "The surface lies so many millimetres above the table's plane in the mean, as a "
                  "thick cloth does; for near lights")
      ->check(CLI::Number)
      ->capture_default_str();
  cmd->add_flag("--relief", args.relief,
                "Find each pixel's height from the normals and solve once more with it, for relief "
                "that near lights see; maps are held whole in memory, height.exr is written");
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_option("--fail-above", args.fail_above_deg,
                  "Exit with status 3 when the mean angular error from truth is above this, in "
                  "degrees (0, 180]; the maps are written all the same")
      ->check(CLI::Validator(FaultOfAngle, "DEG"));
  cmd->add_flag("--json", args.json, "Print the report as one JSON object on stdout");
}

int RunSolve(const SolveArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  const Result<SolveOutcome> outcome = SolveCapture(args, task.WithThreads(args.threads), log);
  task.ClearProgress();
  if (!outcome) {
    log << "sateen solve: error: " << outcome.error().message << '\n';
    return ExitStatus(outcome.error());
  }
  out << (args.json ? JsonReport(args, *outcome) : TextReport(args, *outcome)) << '\n';
  if (!Passed(args, *outcome)) {
    log << "sateen solve: " << WhyNotPassed(args, *outcome) << '\n';
    return ExitStatus({ErrorCode::kBadData, ""});
  }
  return 0;
}

}  // namespace sateen::cli
