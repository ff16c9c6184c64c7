#include "pipelines/calibrate/calibrate_lights.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/angle.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "pipelines/calibrate/pictures/lights_pictures.h"
#include "pipelines/calibrate/rig_record.h"
#include "scanner/sessions/files/pose_json.h"
#include "scanner/sessions/sheet_reader.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr double kPoorDirectionDeg = 0.02;  // above which tilted sheets are asked for
constexpr double kPoorPositionMm = 0.3;
constexpr double kManyLeftOut = 0.1;  // share of the samples
// Share of the distance between two lights; fitted closer than that, they are one.
constexpr double kOneLamp = 0.25;

SheetRecord RecordOf(const SheetFigures& figures) {
  const SheetPose& pose = figures.pose;
  SheetRecord record{.name = figures.name,
                     .tilt_sd_deg = TiltSdDeg(pose),
                     .position_sd_mm = pose.position_sd_mm,
                     .markers = pose.markers_used,
                     .markers_of_border = pose.markers,
                     .misfit = pose.misfit,
                     .blur_px = pose.blur_px,
                     .tilt_error_deg = figures.tilt_error_deg,
                     .position_error_mm = figures.position_error_mm};
  std::ranges::copy(RowMajor(pose.table_from_sheet), record.table_from_sheet.emplace().begin());
  return record;
}

LightRecord RecordOf(const LightFigures& figures) {
  const LightFit& fit = figures.fit;
  LightRecord record{.name = fit.light.name,
                     .model = std::string(Name(fit.light.model)),
                     .moved_mm = figures.moved_mm,
                     .position_sd_mm = fit.position_sd_mm,
                     .direction_sd_deg = fit.direction_sd_rad / kRadPerDeg,
                     .flux_sd = fit.flux_sd,
                     .noise_rms = fit.noise_rms,
                     .samples = fit.used,
                     .samples_left_out = fit.left_out,
                     .position_error_mm = figures.position_error_mm,
                     .direction_error_deg = figures.direction_error_deg,
                     .flux_error = figures.flux_error};
  std::vector<RungRecord>& rungs = record.rungs.emplace();
  for (const RungFit& rung : fit.rungs) {
    rungs.push_back({.model = std::string(Name(rung.light.model)),
                     .held_out_rms = rung.held_out_rms,
                     .residual_rms = rung.residual_rms,
                     .iterations = rung.iterations});
  }
  return record;
}

LightsRecord RecordOf(double albedo, const LightsCalibration& result) {
  LightsRecord record;
  FillCommon("lights", result, record);
  record.albedo = albedo;
  std::vector<SheetRecord>& sheets = record.sheets.emplace();
  for (const SheetFigures& figures : result.sheets) {
    sheets.push_back(RecordOf(figures));
  }
  std::vector<LightRecord>& lights = record.lights.emplace();
  for (const LightFigures& figures : result.lights) {
    lights.push_back(RecordOf(figures));
  }
  std::vector<WayRecord>& ways = record.ways.emplace();
  for (const WayFigures& way : result.ways) {
    ways.push_back({.way = way.key,
                    .flat_sheet_deg = way.flat_deg,
                    .tilted_sheets_deg = way.tilted_deg,
                    .direction_error_deg = way.direction_error_deg});
  }
  return record;
}

class LightsCalibrator {
 public:
  LightsCalibrator(const CalibrateLightsOptions& options, const Task& task)
      : options_(options), task_(task) {}

  Result<LightsCalibration> Run() {
    const Stopwatch stopwatch;
    BeginCalibration(options_.output, "lights", result_);
    const Status status =
        ReadSheets()
            .and_then([&] { return FitAll(); })
            .and_then([&] { return CheckSwapped(); })
            .and_then([&] { return Compare(); })
            .and_then([&] { return DrawLights(sheets_, options_.albedo, result_); });
    if (!status) {
      return tl::unexpected(status.error());
    }
    Warn();
    result_.seconds = stopwatch.Seconds();
    result_.record = RecordOf(options_.albedo, result_);
    if (Status wrote = RecordAndWrite(result_.record, &CalibrationRecords::lights, result_);
        !wrote) {
      return tl::unexpected(wrote.error());
    }
    return std::move(result_);
  }

 private:
  Status ReadSheets() {
    ReadSheetOptions read;
    read.rig_file = RigFileToBeginWith(options_.rough_rig, options_.output);
    if (Status status = ReadBorder(read); !status) {
      return status;
    }
    for (const fs::path& dir : options_.sheets) {
      Result<Sheet> sheet = ReadSheet(dir, read, task_);
      if (!sheet) {
        return tl::unexpected(sheet.error());
      }
      if (!sheets_.empty() && sheet->rig != sheets_[0].rig) {
        return Fail(ErrorCode::kBadData,
                    "{}: its rig differs from that of {}; give the rough rig of all with --rig",
                    dir.string(), options_.sheets[0].string());
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

  Status ReadBorder(ReadSheetOptions& read) const {
    if (options_.border.empty()) {
      return {};
    }
    Result<SheetBorder> border = ParseSheetBorder(options_.border);
    if (!border) {
      return tl::unexpected(border.error());
    }
    read.border = *std::move(border);
    read.find_poses = options_.find_poses;
    return {};
  }

  // Notes the sheet's pose for the report and the warnings.
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
    const LightFitOptions fit{.albedo = options_.albedo, .highest_rung = options_.highest_rung};
    const size_t count = result_.rig.lights.size();
    std::vector<Result<LightFit>> fits(count);
    task_.BeginStage("fitting lights", static_cast<int>(count));
    Status ran = ParallelFor(static_cast<int>(count), 1, task_, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) {
        const auto light = static_cast<size_t>(k);
        fits[light] = FitLight(SamplesOf(light), sheets_[0].rig.lights[light], fit);
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

  // Fails where frames bear each other's names, which puts each light at the other's place.
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
        return Fail(
            ErrorCode::kBadData,
            "the frame of light '{}' is lit from where light '{}' is expected, {:.0f} mm "
            "from its own place: are frames or cables swapped, or one frame there twice{}?",
            rough[k].name, rough[other].name, result_.lights[k].moved_mm,
            options_.border.empty() ? ", or is a border printed on the sheet (--border)" : "");
      }
    }
    return {};
  }

  Status Compare() {
    Lights truth;
    if (Status status = CompareWithTruth(truth); !status) {
      return status;
    }
    result_.ways = CompareWays(sheets_, result_.rig.lights, truth, options_.albedo);
    return task_.CheckCancelled();
  }

  Status CompareWithTruth(Lights& truth_lights) {
    const Result<std::optional<Rig>> truth = ReadTrueRig(options_.sheets[0]);
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

  void Warn() {
    for (size_t s = 0; s < sheets_.size(); ++s) {
      if (auto fault =
              FaultOfSheet(options_.sheets[s], sheets_[s], result_.rig.lights, options_.albedo)) {
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
        result_.warnings.push_back(fmt::format(
            "light '{}': {:.0f} % of the sheet does not follow the light and is left "
            "out; look for folds, dust, shadows and the paper's edge{}",
            fit.light.name, 100.0 * share,
            options_.border.empty() ? ", and name a printed border with --border" : ""));
      }
    }
    if (direction_deg > kPoorDirectionDeg || position_mm > kPoorPositionMm) {
      result_.warnings.push_back(fmt::format(
          "directions are uncertain by {:.2g} degrees and positions by {:.2g} mm: add sheets "
          "tilted by ten degrees to four sides (--sheet), which makes both some fifty times better",
          direction_deg, position_mm));
    }
  }

  const CalibrateLightsOptions& options_;
  const Task& task_;
  std::vector<Sheet> sheets_;
  LightsCalibration result_;
};

}  // namespace

Result<LightsCalibration> CalibrateLightsFromSheets(const CalibrateLightsOptions& options,
                                                    const Task& task) {
  return LightsCalibrator(options, task).Run();
}

}  // namespace sateen
