#include "pipelines/calibrate/calibrate_check.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "core/files/output_folder.h"
#include "core/statistics.h"
#include "core/stopwatch.h"
#include "imaging/image_io.h"
#include "pipelines/calibrate/check_report.h"
#include "pipelines/calibrate/check_words.h"
#include "pipelines/calibrate/pictures/check_pictures.h"
#include "scanner/sessions/sheet_reader.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr double kAnotherScale = 50.0;
constexpr BlockGrid kGrid = {.columns = 48, .rows = 32};

// Returns the dark frame over the dimmest light that is lit, in the channel where it is largest.
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
  RigChecker(const CalibrationCheckOptions& options, const Task& task)
      : options_(options), task_(task) {}

  Result<CalibrationCheck> Run() {
    const Stopwatch stopwatch;
    if (Status status = options_.check.Validate().and_then([&] { return ReadSheets(); }); !status) {
      return tl::unexpected(status.error());
    }
    task_.BeginStage("checking", 1);
    Result<RigCheck> check = CheckRig(result_.rig, views_, faults_, options_.check, task_);
    if (!check) {
      return tl::unexpected(check.error());
    }
    result_.check = std::move(*check);
    if (Status status = CheckScale(); !status) {
      return tl::unexpected(status.error());
    }
    SayWhatIsWrong(options_, result_);
    result_.seconds = stopwatch.Seconds();
    if (Status status = Write(); !status) {
      return tl::unexpected(status.error());
    }
    return std::move(result_);
  }

 private:
  Status ReadSheets() {
    ReadSheetOptions read{.grid = kGrid, .allow_bad_frames = true};
    if (!options_.rig.empty()) {
      read.rig_file = options_.rig;
    }
    if (!options_.border.empty()) {
      Result<SheetBorder> border = ParseSheetBorder(options_.border);
      if (!border) {
        return tl::unexpected(border.error());
      }
      read.border = *std::move(border);
    }
    for (const fs::path& dir : options_.sheets) {
      Result<Sheet> sheet = ReadSheet(dir, read, task_);
      if (!sheet) {
        return tl::unexpected(sheet.error());
      }
      if (!views_.empty() && sheet->rig != result_.rig) {
        return Fail(ErrorCode::kBadData,
                    "{}: its rig differs from that of {}; give the rig to check with --rig",
                    dir.string(), options_.sheets[0].string());
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

  // Fails for lights placed by the ruler, whose fluxes are arbitrary.
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
                  options_.rig.empty() ? options_.sheets[0].string() : options_.rig.string(),
                  ratio);
    }
    return {};
  }

  // ratio.png, ratio-2.png for the second sheet, and check.json.
  Status Write() {
    if (options_.output.empty()) {
      return {};
    }
    Result<OutputFolder> folder = OutputFolder::Open(options_.output);
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
            [&] { return folder->WriteText("check.json", CheckToJson(options_, result_) + "\n"); })
        .and_then([&] { return folder->Commit(); });
  }

  const CalibrationCheckOptions& options_;
  const Task& task_;
  std::vector<SheetReadings> views_;
  std::vector<FrameFault> faults_;
  CalibrationCheck result_;
};

}  // namespace

Result<CalibrationCheck> CheckCalibration(const CalibrationCheckOptions& options,
                                          const Task& task) {
  return RigChecker(options, task).Run();
}

}  // namespace sateen
