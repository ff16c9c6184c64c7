#include "cli/calibrate/calibrate_lights.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "cli/calibrate/calibrate_lights_report.h"
#include "core/angle.h"
#include "core/output_folder.h"
#include "core/parallel.h"
#include "imaging/image_io.h"
#include "imaging/show/canvas.h"
#include "imaging/show/pictures.h"
#include "pipelines/calibrate/rig_record.h"
#include "scanner/sessions/sheet_reader.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kPoorDirectionDeg = 0.02;  // above which tilted sheets are asked for
constexpr double kPoorPositionMm = 0.3;
constexpr double kManyLeftOut = 0.1;  // share of the samples
constexpr double kOneLamp =
    0.25;  // of the distance between two lights: fitted closer, they are one
constexpr int kResidualPanelPx = 240;
constexpr int kResidualColumns = 5;
constexpr float kPercent = 100.0F;

LightModel HighestRung(std::string_view name) {
  for (const LightModel model : {LightModel::kNear, LightModel::kLed}) {
    if (name == Name(model)) {
      return model;
    }
  }
  return LightModel::kLedField;
}

class LightsCalibrator {
 public:
  LightsCalibrator(const CalibrateLightsArgs& args, const Task& task) : args_(args), task_(task) {}

  Result<LightsCalibration> Run() {
    const auto start = std::chrono::steady_clock::now();
    const Status status = ReadSheets()
                              .and_then([&] { return FitAll(); })
                              .and_then([&] { return CheckSwapped(); })
                              .and_then([&] { return Compare(); })
                              .and_then([&] { return Draw(); });
    if (!status) {
      return tl::unexpected(status.error());
    }
    Warn();
    result_.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(result_);
  }

 private:
  Status ReadSheets() {
    ReadSheetOptions options;
    options.rig_file = RigFileToBeginWith(args_.rough_rig, args_.output);
    if (Status status = ReadBorder(options); !status) {
      return status;
    }
    for (const fs::path& dir : args_.sheets) {
      Result<Sheet> sheet = ReadSheet(dir, options, task_);
      if (!sheet) {
        return tl::unexpected(sheet.error());
      }
      if (!sheets_.empty() && RigToJson(sheet->rig) != RigToJson(sheets_[0].rig)) {
        return Fail(ErrorCode::kBadData,
                    "{}: its rig differs from that of {}; give the rough rig of all with --rig",
                    dir.string(), args_.sheets[0].string());
      }
      result_.sha256_of_input.merge(sheet->sha256_of_input);
      result_.warnings.insert(result_.warnings.end(), sheet->warnings.begin(),
                              sheet->warnings.end());
      if (Status status = NotePose(dir, *sheet); !status) {
        return status;
      }
      sheets_.push_back(std::move(*sheet));
    }
    result_.rig = sheets_[0].rig;
    return {};
  }

  Status ReadBorder(ReadSheetOptions& options) const {
    if (args_.border.empty()) {
      return {};
    }
    Result<SheetBorder> border = ParseSheetBorder(args_.border);
    if (!border) {
      return tl::unexpected(border.error());
    }
    options.border = *std::move(border);
    options.find_poses = args_.find_poses;
    return {};
  }

  // What is known of the sheet's pose, for the report and the warnings.
  Status NotePose(const fs::path& dir, const Sheet& sheet) {
    if (!sheet.found_pose && !sheet.pose_is_recorded && !sheets_.empty()) {
      result_.warnings.push_back(
          fmt::format("{}: its pose is neither recorded nor found, so it is taken to lie flat on "
                      "the table; name its marker border with --border",
                      dir.string()));
    }
    if (!sheet.found_pose) {
      return {};
    }
    Result<SheetFigures> figures = FiguresOfSheet(dir, sheet);
    if (!figures) {
      return tl::unexpected(figures.error());
    }
    result_.sheets.push_back(*std::move(figures));
    return {};
  }

  [[nodiscard]] std::vector<SheetSample> SamplesOf(size_t light) const {
    std::vector<SheetSample> samples;
    for (const Sheet& sheet : sheets_) {
      samples.insert(samples.end(), sheet.samples[light].begin(), sheet.samples[light].end());
    }
    return samples;
  }

  Status FitAll() {
    const LightFitOptions options{.albedo = args_.albedo,
                                  .highest_rung = HighestRung(args_.highest_rung)};
    const size_t count = result_.rig.lights.size();
    std::vector<Result<LightFit>> fits(count);
    task_.BeginStage("fitting lights", static_cast<int>(count));
    Status ran = ParallelFor(static_cast<int>(count), 1, task_, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) {
        const auto light = static_cast<size_t>(k);
        fits[light] = FitLight(SamplesOf(light), sheets_[0].rig.lights[light], options);
      }
    });
    if (!ran) {
      return ran;
    }
    for (size_t k = 0; k < count; ++k) {
      const Light& rough = sheets_[0].rig.lights[k];
      if (!fits[k]) {
        return Fail(fits[k].error().code, "light '{}': {}", rough.name, fits[k].error().message);
      }
      result_.rig.lights[k] = fits[k]->light;
      const double moved_mm = (fits[k]->light.position_mm - rough.position_mm).norm();
      result_.lights.push_back({.fit = std::move(*fits[k]), .moved_mm = moved_mm});
    }
    return {};
  }

  // Frames under each other's names put each light where the other was expected.
  [[nodiscard]] Status CheckSwapped() const {
    const Lights& rough = sheets_[0].rig.lights;
    const auto nearest = [&](size_t light) {
      size_t best = 0;
      for (size_t k = 1; k < rough.size(); ++k) {
        const Eigen::Vector3d& at = result_.rig.lights[light].position_mm;
        if ((rough[k].position_mm - at).norm() < (rough[best].position_mm - at).norm()) {
          best = k;
        }
      }
      return best;
    };
    for (size_t k = 0; k < rough.size(); ++k) {
      const size_t other = nearest(k);
      const double apart_mm = (rough[k].position_mm - rough[other].position_mm).norm();
      const double fitted_apart_mm =
          (result_.rig.lights[k].position_mm - result_.rig.lights[other].position_mm).norm();
      if (other != k && (nearest(other) != other || fitted_apart_mm < kOneLamp * apart_mm)) {
        return Fail(ErrorCode::kBadData,
                    "the frame of light '{}' is lit from where light '{}' is expected, {:.0f} mm "
                    "from its own place: are frames or cables swapped, or one frame there twice{}?",
                    rough[k].name, rough[other].name, result_.lights[k].moved_mm,
                    args_.border.empty() ? ", or is a border printed on the sheet (--border)" : "");
      }
    }
    return {};
  }

  Status Compare() {
    Lights truth;
    if (Status status = CompareWithTruth(truth); !status) {
      return status;
    }
    result_.ways = CompareWays(sheets_, result_.rig.lights, truth, args_.albedo);
    return task_.CheckCancelled();
  }

  Status CompareWithTruth(Lights& truth_lights) {
    const Result<std::optional<Rig>> truth = ReadTrueRig(args_.sheets[0]);
    if (!truth) {
      return tl::unexpected(truth.error());
    }
    if (!*truth) {
      return {};
    }
    truth_lights =
        Rebalanced((*truth)->lights, WhiteBalanceOf(**truth), WhiteBalanceOf(result_.rig));
    for (size_t k = 0; k < result_.lights.size(); ++k) {
      const Light& fitted = result_.rig.lights[k];
      const auto light = std::ranges::find(truth_lights, fitted.name, &Light::name);
      if (light == truth_lights.end()) {
        continue;
      }
      LightFigures& figures = result_.lights[k];
      figures.position_error_mm = (fitted.position_mm - light->position_mm).norm();
      figures.direction_error_deg = DirectionErrorDeg(fitted, *light, SamplesOf(k));
      figures.flux_error =
          (fitted.flux_rgb.cwiseQuotient(light->flux_rgb) - Eigen::Vector3d::Ones())
              .cwiseAbs()
              .maxCoeff();
    }
    return {};
  }

  // |measured / expected - 1| in per cent on the first sheet, block by block.
  [[nodiscard]] Rgb8 ResidualPanel(size_t light, const Light& expected, float top) const {
    const Sheet& sheet = sheets_[0];
    Image<float> misfit(sheet.grid.columns, sheet.grid.rows);
    Image<uint8_t> known(sheet.grid.columns, sheet.grid.rows);
    for (size_t i = 0; i < sheet.blocks[light].size(); ++i) {
      const SheetSample& sample = sheet.samples[light][i];
      const Incident in = IncidentAt(expected, sample.point_mm);
      const double green = args_.albedo * in.e_rgb[1] * std::max(0.0, sample.normal.dot(in.l));
      const auto block = static_cast<size_t>(sheet.blocks[light][i]);
      misfit.pixels[block] =
          kPercent * static_cast<float>(std::abs(sample.radiance_rgb[1] / green - 1.0));
      known.pixels[block] = 1;
    }
    return Captioned(Enlarged(ShowHeat(misfit, top, known), kResidualPanelPx / sheet.grid.columns),
                     fmt::format("{}: white {:g} %", expected.name, top));
  }

  // The rough light with the flux that fits it best, as a ruler and a light meter would have it.
  [[nodiscard]] Light RoughWithFlux(size_t light) const {
    Light rough = sheets_[0].rig.lights[light];
    const std::vector<SheetSample>& samples = sheets_[0].samples[light];
    double measured = 0.0;
    double expected = 0.0;
    for (const SheetSample& sample : samples) {
      const Incident in = IncidentAt(rough, sample.point_mm);
      measured += sample.radiance_rgb[1];
      expected += args_.albedo * in.e_rgb[1] * std::max(0.0, sample.normal.dot(in.l));
    }
    rough.flux_rgb *= measured / expected;
    return rough;
  }

  Status Draw() {
    result_.pictures = args_.output;
    result_.pictures.replace_filename(args_.output.stem().string() + "-lights");
    Result<OutputFolder> folder = OutputFolder::Open(result_.pictures);
    if (!folder) {
      return tl::unexpected(folder.error());
    }
    std::vector<Rgb8> before;
    std::vector<Rgb8> after;
    for (size_t k = 0; k < result_.lights.size(); ++k) {
      before.push_back(ResidualPanel(k, RoughWithFlux(k), kBeforeTop));
      after.push_back(ResidualPanel(k, result_.rig.lights[k], kAfterTop));
    }
    return WritePng8(folder->Stage("before.png"), ContactSheet(before, kResidualColumns))
        .and_then([&] {
          return WritePng8(folder->Stage("residuals.png"), ContactSheet(after, kResidualColumns));
        })
        .and_then([&] { return folder->Commit(); });
  }

  void Warn() {
    for (size_t s = 0; s < sheets_.size(); ++s) {
      if (auto fault =
              FaultOfSheet(args_.sheets[s], sheets_[s], result_.rig.lights, args_.albedo)) {
        result_.warnings.push_back(*std::move(fault));
      }
    }
    double direction_deg = 0.0;
    double position_mm = 0.0;
    for (const LightFigures& figures : result_.lights) {
      const LightFit& fit = figures.fit;
      direction_deg = std::max(direction_deg, fit.direction_sd_rad / kRadPerDeg);
      position_mm = std::max(position_mm, fit.position_sd_mm.norm());
      const double share =
          static_cast<double>(fit.left_out) / static_cast<double>(fit.left_out + fit.used);
      if (share > kManyLeftOut) {
        result_.warnings.push_back(
            fmt::format("light '{}': {:.0f} % of the sheet does not follow the light and is left "
                        "out; look for folds, dust, shadows and the paper's edge{}",
                        fit.light.name, 100.0 * share,
                        args_.border.empty() ? ", and name a printed border with --border" : ""));
      }
    }
    if (direction_deg > kPoorDirectionDeg || position_mm > kPoorPositionMm) {
      result_.warnings.push_back(fmt::format(
          "directions are uncertain by {:.2g} degrees and positions by {:.2g} mm: add sheets "
          "tilted by ten degrees to four sides (--sheet), which makes both some fifty times better",
          direction_deg, position_mm));
    }
  }

  static constexpr float kBeforeTop = 10.0F;  // [%] that is shown white
  static constexpr float kAfterTop = 1.0F;

  const CalibrateLightsArgs& args_;
  const Task task_;
  std::vector<Sheet> sheets_;
  LightsCalibration result_;
};

}  // namespace

void AddCalibrateLights(CLI::App& calibrate, CalibrateLightsArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "lights", "Positions and intensities of the lights from sheets of white paper");
  cmd->add_option("--sheet", args.sheets,
                  "Session of a white sheet; flat first, then tilted ones, as many as there are")
      ->required();
  cmd->add_option("-o,--output", args.output, "Rig file to write; a former one is kept as a copy")
      ->required();
  CLI::Option* border =
      cmd->add_option("--border", args.border,
                      "Marker border printed on the sheets, such as sheet:A4:12mm (sateen board "
                      "print); tells where they lie where sessions have no table_from_sheet");
  cmd->add_flag("--find-poses", args.find_poses,
                "Find poses by the border also where sessions have table_from_sheet")
      ->needs(border);
  cmd->add_option("--rig", args.rough_rig,
                  "Rough rig: camera, and lights to within some 50 mm; default: what is at -o, or "
                  "else the session's own");
  cmd->add_option("--model", args.highest_rung,
                  "Highest rung of the model ladder: near, led or led+field")
      ->check(CLI::IsMember({"near", "led", "led+field"}))
      ->capture_default_str();
  cmd->add_option("--albedo", args.albedo, "Albedo of the paper, above 0 and up to 1")
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the table");
}

int RunCalibrateLights(const CalibrateLightsArgs& args, const Task& task, std::ostream& out,
                       std::ostream& log) {
  Result<LightsCalibration> result = LightsCalibrator(args, task.WithThreads(args.threads)).Run();
  task.ClearProgress();
  return FinishCalibration("lights", args, std::move(result), out, log);
}

}  // namespace sateen::cli
