#include "cli/solve.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "cli/choice.h"
#include "cli/solve_report.h"
#include "imaging/encoding_name.h"
#include "pipelines/solve/solve.h"

namespace sateen::cli {
namespace {

// CLI11's own ranges let "nan" pass.
std::string FaultOfAngle(const std::string& text) {
  double angle_deg = 0.0;
  const bool is_angle =
      CLI::detail::lexical_cast(text, angle_deg) && angle_deg > 0.0 && angle_deg <= 180.0;
  return is_angle ? "" : fmt::format("{} is not an angle in (0, 180] degrees", text);
}

std::string WhyNotPassed(double limit_deg, const Evaluation& evaluation) {
  if (!evaluation.angular_error_deg) {
    return fmt::format("no solved pixel has truth to compare with for --fail-above {}", limit_deg);
  }
  return fmt::format("mean angular error {:.4g} deg is above --fail-above {}",
                     evaluation.angular_error_deg->mean, limit_deg);
}

// Adds what is read and where the maps go.
void AddFiles(CLI::App& cmd, SolveOptions& options) {
  cmd.add_option(
         "capture", options.capture,
         "Session folder (session.json), DiLiGenT folder, RTI .lp file, folder of images with a "
         "lights.txt in it or one folder up, or with --rig a folder of images alone")
      ->required();
  cmd.add_option("-o,--output", options.output, "Folder for the maps; created if missing")
      ->required();
  cmd.add_option("--rig", options.rig_file, "rig.json to use instead of the capture's own lights");
  cmd.add_option("--mask", options.mask_file,
                 "Image that is white where to solve, instead of the capture's own mask");
  cmd.add_option("--truth", options.truth_dir,
                 "Simulated session whose truth the maps are compared with: DIR/truth/normal.exr "
                 "and albedo.exr");
  cmd.add_option("--lights", options.lights, "Use only these lights, by index: 0,10,20")
      ->delimiter(',')
      ->allow_extra_args(false);  // or it would take the capture for a light
}

// Adds how each pixel is solved.
void AddMethod(CLI::App& cmd, SolveOptions& options) {
  LambertianOptions& solver = options.least_squares;
  AddChoice(cmd, "--backend",
            "Solver of the least squares. auto: fast, and the reference (jacobi-svd) where fast "
            "is not exact enough",
            {Backend::kAuto, Backend::kFast, Backend::kJacobiSvd, Backend::kQr, Backend::kLdlt},
            solver.backend);
  AddChoice(cmd, "--robust",
            "Treatment of samples off the Lambertian model. auto: each pixel takes the lowest "
            "rung that explains it; least-squares, robust: that rung everywhere; none: least "
            "squares without weights and without uncertainty",
            {std::optional(LadderMode::kAuto), std::optional(LadderMode::kLeastSquares),
             std::optional(LadderMode::kConsensus), std::optional<LadderMode>()},
            options.robust);
  AddChoice(cmd, "--domain",
            "Samples that are solved. raw: each site of the mosaic from readings of its own "
            "colour; rgb: colours interpolated at every pixel; auto: raw if all frames are camera "
            "RAW, with one exposure per light, and aligned",
            {Domain::kAuto, Domain::kRaw, Domain::kRgb}, options.domain);
  cmd.add_option("--shadow-level", solver.shadow_level,
                 "Leave out samples at or below this fraction of the pixel's brightest [0, 1)")
      ->capture_default_str();
  cmd.add_option("--clip-level", solver.clip_level,
                 "Leave out samples at or above this fraction of full scale (0, 1]")
      ->capture_default_str();
  cmd.add_option("--dark-level", solver.dark_level,
                 "Pixels with no sample above this fraction of full scale are dark [0, 1)")
      ->capture_default_str();
  cmd.add_option("--max-condition", solver.max_condition,
                 "Pixels whose usable lights have a larger condition number are not solved "
                 "[2, 1e6]")
      ->capture_default_str();
}

// Adds where the surface lies and how the maps show it.
void AddMaps(CLI::App& cmd, SolveOptions& options) {
  AddChoice(cmd, "--normal-y", "Normal maps with y up (OpenGL, glTF) or down (DirectX)",
            {NormalY::kUp, NormalY::kDown}, options.normal_y);
  cmd.add_flag("--undistort", options.undistort,
               "Write the maps as a camera without the lens's distortion would have them");
  AddChoice(cmd, "--encoding",
            "Encoding of integer image files; auto: 8 bits are sRGB, 16 bits are linear",
            {Encoding::kAuto, Encoding::kLinear, Encoding::kSrgb}, options.encoding);
  cmd.add_option("--max-megapixels", options.max_megapixels,
                 "Read frames of up to this many megapixels, however small their files; without "
                 "it, files that unfold into far more than a photograph are refused")
      ->check(CLI::Range(1, 2000));
  cmd.add_option("--height", options.height_mm,
                 "Mean height of the surface above the table in millimetres, for thick cloth under "
                 "near lights")
      ->check(CLI::Number)
      ->capture_default_str();
  cmd.add_flag("--relief", options.relief,
               "Find each pixel's height from the normals and solve once more with it, for relief "
               "under near lights; holds the maps whole in memory and writes height.exr");
}

}  // namespace

void AddSolve(CLI::App& root, SolveArgs& args) {
  CLI::App* cmd =
      root.add_subcommand("solve", "Solve surface normal and albedo for every pixel of a capture");
  AddFiles(*cmd, args.options);
  AddMethod(*cmd, args.options);
  AddMaps(*cmd, args.options);
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_option("--fail-above", args.options.fail_above_deg,
                  "Exit with status 3 when the mean angular error from truth is above this, in "
                  "degrees (0, 180]; the maps are written all the same")
      ->check(CLI::Validator(FaultOfAngle, "DEG"));
  cmd->add_flag("--json", args.json, "Print the report as one JSON object on stdout");
}

int RunSolve(const SolveArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  const Result<SolveOutcome> outcome =
      SolveSession(args.options, task.WithThreads(args.threads), [&](const std::string& warning) {
        task.ClearProgress();
        log << "sateen solve: warning: " << warning << '\n';
      });
  task.ClearProgress();
  if (!outcome) {
    log << "sateen solve: error: " << outcome.error().message << '\n';
    return ExitStatus(outcome.error());
  }
  out << (args.json ? outcome->report : TextReport(args.options, *outcome)) << '\n';
  if (!Passed(args.options, outcome->evaluation)) {
    log << "sateen solve: " << WhyNotPassed(*args.options.fail_above_deg, outcome->evaluation)
        << '\n';
    return ExitStatus({ErrorCode::kBadData, ""});
  }
  return 0;
}

}  // namespace sateen::cli
