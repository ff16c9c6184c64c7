#include "cli/calibrate/calibrate_check.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <limits>
#include <ostream>
#include <utility>

#include "calibration/fit/robust_spread.h"
#include "cli/calibrate/calibrate_check_report.h"
#include "core/output_folder.h"
#include "imaging/image_io.h"
#include "imaging/show/pictures.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kAnotherScale = 50.0;
constexpr BlockGrid kGrid = {.columns = 48, .rows = 32};

// The dark frame over the dimmest light that is lit, in the channel where that is most.
double AmbientPercent(const Sheet& sheet) {
  if (!sheet.dark_rgb) {
    return 0.0;
  }
  double worst = 0.0;
  for (const std::vector<SheetSample>& samples : sheet.samples) {
    for (Eigen::Index c = 0; c < 3 && !samples.empty(); ++c) {
      std::vector<double> radiances;
      radiances.reserve(samples.size());
      for (const SheetSample& sample : samples) {
        radiances.push_back(sample.radiance_rgb[c]);
      }
      const double percent = 100.0 * (*sheet.dark_rgb)[c] / Median(std::move(radiances));
      worst = std::abs(percent) > std::abs(worst) ? percent : worst;
    }
  }
  return worst;
}

class RigChecker {
 public:
  RigChecker(const CalibrateCheckArgs& args, const Task& task) : args_(args), task_(task) {}

  Result<CalibrationCheck> Run() {
    const auto start = std::chrono::steady_clock::now();
    if (Status status = args_.options.Validate().and_then([&] { return ReadSheets(); }); !status) {
      return tl::unexpected(status.error());
    }
    task_.BeginStage("checking", 1);
    Result<RigCheck> check = CheckRig(result_.rig, views_, faults_, args_.options, task_);
    if (!check) {
      return tl::unexpected(check.error());
    }
    result_.check = std::move(*check);
    if (Status status = CheckScale(); !status) {
      return tl::unexpected(status.error());
    }
    SayWhatIsWrong(args_, result_);
    result_.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (Status status = Write(); !status) {
      return tl::unexpected(status.error());
    }
    return std::move(result_);
  }

 private:
  Status ReadSheets() {
    ReadSheetOptions options{.grid = kGrid, .allow_bad_frames = true};
    if (!args_.rig.empty()) {
      options.rig_file = args_.rig;
    }
    if (!args_.border.empty()) {
      Result<SheetBorder> border = ParseSheetBorder(args_.border);
      if (!border) {
        return tl::unexpected(border.error());
      }
      options.border = *std::move(border);
    }
    for (const fs::path& dir : args_.sheets) {
      Result<Sheet> sheet = ReadSheet(dir, options, task_);
      if (!sheet) {
        return tl::unexpected(sheet.error());
      }
      if (!views_.empty() && RigToJson(sheet->rig) != RigToJson(result_.rig)) {
        return Fail(ErrorCode::kBadData,
                    "{}: its rig differs from that of {}; give the rig to check with --rig",
                    dir.string(), args_.sheets[0].string());
      }
      const double ambient = AmbientPercent(*sheet);
      result_.ambient_percent =
          std::abs(ambient) > std::abs(result_.ambient_percent) ? ambient : result_.ambient_percent;
      if (!sheet->dark_rgb) {
        result_.notes.push_back(dir.string() +
                                ": has no dark frame; room light counts as the lights' own");
      }
      result_.notes.insert(result_.notes.end(), sheet->warnings.begin(), sheet->warnings.end());
      result_.sha256_of_input.insert(sheet->sha256_of_input.begin(), sheet->sha256_of_input.end());
      faults_.resize(sheet->faults.size(), FrameFault::kNone);
      for (size_t k = 0; k < faults_.size(); ++k) {
        faults_[k] = std::max(faults_[k], sheet->faults[k]);
      }
      views_.push_back({.columns = sheet->grid.columns,
                        .rows = sheet->grid.rows,
                        .blank_blocks = sheet->blank_blocks,
                        .samples = std::move(sheet->samples),
                        .blocks = std::move(sheet->blocks)});
      result_.rig = std::move(sheet->rig);
    }
    return {};
  }

  // Lights by the ruler, whose fluxes are numbers of anyone's choice.
  [[nodiscard]] Status CheckScale() const {
    std::vector<double> ratios;
    for (const std::vector<std::vector<double>>& of_sheet : result_.check.ratios) {
      for (const std::vector<double>& of_light : of_sheet) {
        ratios.insert(ratios.end(), of_light.begin(), of_light.end());
      }
    }
    const double ratio = Median(std::move(ratios));
    if (!(ratio < kAnotherScale && ratio > 1.0 / kAnotherScale)) {
      return Fail(ErrorCode::kBadData,
                  "{}: the sheets are {:.3g} times as bright as this rig says: its lights are of "
                  "another exposure, or were never calibrated; run sateen calibrate lights",
                  args_.rig.empty() ? args_.sheets[0].string() : args_.rig.string(), ratio);
    }
    return {};
  }

  // ratio.png, ratio-2.png for the second sheet, and check.json.
  Status Write() {
    if (args_.output.empty()) {
      return {};
    }
    Result<OutputFolder> folder = OutputFolder::Open(args_.output);
    if (!folder) {
      return tl::unexpected(folder.error());
    }
    Status status;
    for (size_t s = 0; s < views_.size() && status; ++s) {
      const std::string name = s == 0 ? "ratio.png" : fmt::format("ratio-{}.png", s + 1);
      status = WritePng8(folder->Stage(name), RatioPicture(result_, s, views_[s]));
    }
    return status
        .and_then(
            [&] { return folder->WriteText("check.json", JsonReport(args_, result_) + "\n"); })
        .and_then([&] { return folder->Commit(); });
  }

  const CalibrateCheckArgs& args_;
  const Task task_;
  std::vector<SheetReadings> views_;
  std::vector<FrameFault> faults_;
  CalibrationCheck result_;
};

}  // namespace

void AddCalibrateCheck(CLI::App& calibrate, CalibrateCheckArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "check", "Whether the calibration still holds, from a sheet of white paper");
  cmd->add_option("--sheet", args.sheets,
                  "Session of a white sheet that lies flat; more, tilted ones, see smaller moves")
      ->required();
  cmd->add_option("--rig", args.rig, "The rig to check; the session's own");
  cmd->add_option(
      "--border", args.border,
      "Marker border printed on the sheets, such as sheet:A4:12mm; tells where they lie "
      "where sessions have no table_from_sheet");
  cmd->add_option("-o,--output", args.output,
                  "Folder for ratio.png, today's paper over what the rig says, and check.json");
  cmd->add_option("--albedo", args.options.albedo, "Albedo of the paper, above 0 and up to 1")
      ->capture_default_str();
  cmd->add_option("--max-direction", args.options.max_direction_deg,
                  "Largest change of a light's direction over the field [degrees] (0, 90)")
      ->capture_default_str();
  cmd->add_option("--max-flux", args.options.max_flux_percent,
                  "Largest change of a light's flux against that of all [%] (0, 100)")
      ->capture_default_str();
  cmd->add_option("--max-common-flux", args.options.max_common_flux_percent,
                  "Largest change of all lights' flux together [%] (0, 100)")
      ->capture_default_str();
  cmd->add_option("--max-sheet-slope", args.options.max_sheet_deg,
                  "Largest slope of the sheet against how it was said to lie [degrees] (0, 45)")
      ->capture_default_str();
  cmd->add_option("--max-spoilt", args.options.max_spoilt_percent,
                  "Largest share of the field with spots, folds or no paper [%] (0, 100)")
      ->capture_default_str();
  cmd->add_option("--max-ambient", args.max_ambient_percent,
                  "Largest dark frame against the dimmest light [%] (0, 100)")
      ->check(CLI::Range(1e-6, 100.0))
      ->capture_default_str();
  cmd->add_option("--significance", args.options.significance,
                  "Standard deviations that a change must be from none [2, 100]")
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the table");
  cmd->footer(
      "Exit status 0 where nothing is wrong as far as the sheets can tell, 3 where the calibration "
      "does not hold.");
}

int RunCalibrateCheck(const CalibrateCheckArgs& args, const Task& task, std::ostream& out,
                      std::ostream& log) {
  const Result<CalibrationCheck> result = RigChecker(args, task.WithThreads(args.threads)).Run();
  task.ClearProgress();
  if (!result) {
    log << "sateen calibrate check: error: " << result.error().message << '\n';
    return ExitStatus(result.error());
  }
  for (const std::string& note : result->notes) {
    log << "sateen calibrate check: note: " << note << '\n';
  }
  out << (args.json ? JsonReport(args, *result) + "\n" : TextReport(args, *result));
  return result->faults.empty() ? 0 : ExitStatus({ErrorCode::kBadData, ""});
}

}  // namespace sateen::cli
