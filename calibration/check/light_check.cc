#include "calibration/check/light_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calibration/check/change_choice.h"
#include "calibration/check/check_fit.h"
#include "calibration/check/check_model.h"
#include "calibration/check/check_settle.h"
#include "calibration/check/lit_from.h"
#include "core/angle.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr size_t kFewestSamples = 50;
constexpr size_t kFewestForCommon = 3;  // lights for a common flux

Status InRange(const char* name, double value, double above, double below) {
  return value > above && value < below
             ? Status()
             : Status(Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {:g} < {} < {:g}", name,
                           value, above, name, below));
}

double WorstDirectionChange(const std::vector<SheetSample>& samples,
                            const Eigen::Vector3d& position_mm, const Eigen::Vector3d& moved_mm) {
  double worst = 0.0;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector3d was = position_mm - sample.point_mm;
    const Eigen::Vector3d is = was + moved_mm;
    worst = std::max(worst, AngleBetweenRad(was, is));
  }
  return worst;
}

class Checker {
 public:
  Checker(const Rig& rig, const std::vector<SheetReadings>& sheets,
          const LightCheckOptions& options, std::vector<bool> used, const Task& task,
          RigCheck& check)
      : rig_(rig),
        sheets_(sheets),
        options_(options),
        used_(std::move(used)),
        task_(task),
        check_(check),
        model_(rig, sheets, options.albedo),
        weights_(SettledWeights(model_, used_, task)) {}

  Status Run() {
    Result<ChangeChoice> choice = ChooseChange(model_, weights_, task_);
    if (!choice) {
      return tl::unexpected(choice.error());
    }
    fit_ = std::move(choice->fit);
    mask_ = std::move(choice->mask);
    gains_ = GainsOf(model_, weights_, fit_, task_);
    check_.change = fit_.change;
    JudgeFlux();
    for (size_t k = 0; k < used_.size(); ++k) {
      if (used_[k]) {
        JudgePlace(k);
        JudgeVerdict(k);
      }
    }
    JudgeCamera();
    JudgeSheets();
    Compare();
    return {};
  }

 private:
  void JudgeFlux() {
    size_t count = 0;
    for (Eigen::Index c = 0; c < 3; ++c) {
      std::vector<double> logs;
      for (size_t k = 0; k < used_.size(); ++k) {
        if (used_[k]) {
          logs.push_back(fit_.change.lights[k].log_flux[c]);
        }
      }
      count = logs.size();
      std::ranges::sort(logs);
      common_[c] = count < kFewestForCommon ? 0.0 : InterpolatedQuantile(logs, 0.5);
    }
    check_.common_flux = common_.array().exp();
    check_.is_common_flux_off = (check_.common_flux.array() - 1.0).abs().maxCoeff() >
                                0.01 * options_.max_common_flux_percent;
    for (size_t k = 0; k < used_.size(); ++k) {
      LightCheck& light = check_.lights[k];
      if (!used_[k]) {
        continue;
      }
      light.flux_ratio = (fit_.change.lights[k].log_flux - common_).array().exp();
      light.flux_sd = fit_.flux[k].diagonal().cwiseSqrt().cwiseProduct(light.flux_ratio);
      for (Eigen::Index c = 0; c < 3; ++c) {
        const double off = std::abs(light.flux_ratio[c] - 1.0);
        light.is_flux_off = light.is_flux_off || (off > 0.01 * options_.max_flux_percent &&
                                                  off > options_.significance * light.flux_sd[c]);
      }
    }
  }

  void JudgePlace(size_t k) {
    LightCheck& light = check_.lights[k];
    const std::vector<SheetSample>& samples = sheets_[0].samples[k];
    const Eigen::Vector3d& at = rig_.lights[k].position_mm;
    const Eigen::Matrix3d covariance = mask_.moved[k] ? fit_.moved_mm2[k] : gains_[k].moved_mm2;
    light.moved_mm = fit_.change.lights[k].moved_mm;
    light.moved_sd_mm = covariance.diagonal().cwiseSqrt();
    light.direction_deg = WorstDirectionChange(samples, at, light.moved_mm) * kDegPerRad;
    light.direction_sd_deg = WorstDirectionSd(samples, at, covariance) * kDegPerRad;
    light.turned_deg = std::atan(fit_.change.lights[k].turned_rad.norm()) * kDegPerRad;
    light.turned_sd_deg =
        std::sqrt(std::max(0.0, fit_.turned_rad2[k].diagonal().maxCoeff())) * kDegPerRad;
    light.is_unclear = options_.significance * light.direction_sd_deg > options_.max_direction_deg;
  }

  // Returns the largest change of irradiance over the field by the turn of the axis, from its mean.
  [[nodiscard]] double UnevenByTurning(size_t k) const {
    RigChange without = fit_.change;
    without.lights[k].turned_rad.setZero();
    double least = std::numeric_limits<double>::infinity();
    double most = 0.0;
    for (const SheetSample& sample : sheets_[0].samples[k]) {
      const double ratio =
          model_.Predict(0, k, sample, fit_.change)[1] / model_.Predict(0, k, sample, without)[1];
      least = std::min(least, ratio);
      most = std::max(most, ratio);
    }
    return 0.5 * (most / least - 1.0);
  }

  void JudgeVerdict(size_t k) {
    LightCheck& light = check_.lights[k];
    const double low = light.flux_ratio.minCoeff();
    const double high = light.flux_ratio.maxCoeff();
    if (mask_.moved[k] && light.direction_deg > options_.max_direction_deg) {
      light.verdict = LightVerdict::kMoved;
    } else if (mask_.turned[k] && UnevenByTurning(k) > 0.01 * options_.max_flux_percent) {
      light.verdict = LightVerdict::kTurned;
    } else if (light.is_flux_off) {
      light.verdict = 1.0 - low >= high - 1.0 ? LightVerdict::kDim : LightVerdict::kBright;
    }
    check_.holds = check_.holds && light.verdict == LightVerdict::kHolds;
  }

  // Judges the camera: a pixel that looks d to one side sees a light as moved by d to the other.
  void JudgeCamera() {
    CameraCheck& camera = check_.camera;
    if (mask_.camera) {
      camera.moved_mm = fit_.change.camera.head<3>();
      camera.moved_sd_mm = fit_.camera.diagonal().head<3>().cwiseSqrt();
      camera.turned_deg = fit_.change.camera[3] * kDegPerRad;
      camera.turned_sd_deg = std::sqrt(fit_.camera(3, 3)) * kDegPerRad;
      const Eigen::Vector3d eye_mm = rig_.camera->table_from_camera.translation();
      for (size_t k = 0; k < used_.size(); ++k) {
        for (size_t j = 0; used_[k] && j < sheets_[0].samples[k].size(); ++j) {
          const SheetSample& sample = sheets_[0].samples[k][j];
          const Eigen::Vector3d ray = sample.point_mm - eye_mm;
          const Eigen::Vector3d at = rig_.lights[k].position_mm - sample.point_mm;
          const Eigen::Vector3d by =
              camera.moved_mm + fit_.change.camera[3] * Eigen::Vector3d::UnitZ().cross(ray) -
              ray * (camera.moved_mm.dot(sample.normal) / ray.dot(sample.normal));
          camera.direction_deg =
              std::max(camera.direction_deg, AngleBetweenRad(at, at - by) * kDegPerRad);
        }
      }
    }
    camera.has_moved = camera.direction_deg > options_.max_direction_deg;
    check_.holds = check_.holds && !camera.has_moved && !check_.is_common_flux_off;
  }

  void JudgeSheets() {
    for (size_t s = 0; s < sheets_.size(); ++s) {
      SheetSurface surface =
          SurfaceOf(sheets_[s], rig_.lights, [&](size_t k, const SheetSample& sample) {
            return used_[k] ? model_.Predict(s, k, sample, fit_.change)[1] : 0.0;
          });
      const CheckModel::Lie lie = model_.LieOf(s, fit_.change);
      surface.slope_deg = lie.slope_rad * kDegPerRad;
      surface.height_mm = lie.height_mm;
      surface.is_off = surface.slope_deg > options_.max_sheet_deg ||
                       surface.spots + surface.folds > 0.01 * options_.max_spoilt_percent;
      check_.holds = check_.holds && !surface.is_off;
      check_.sheets.push_back(surface);
    }
  }

  void Compare() {
    const RigChange unchanged = model_.Unchanged();
    check_.ratios.resize(sheets_.size());
    for (size_t s = 0; s < sheets_.size(); ++s) {
      for (size_t k = 0; k < rig_.lights.size(); ++k) {
        std::vector<double>& ratios = check_.ratios[s].emplace_back();
        for (const SheetSample& sample : sheets_[s].samples[k]) {
          const double expected = model_.Predict(s, k, sample, unchanged)[1];
          ratios.push_back(expected > 0.0 ? sample.radiance_rgb[1] / expected : 0.0);
        }
      }
    }
  }

  const Rig& rig_;
  const std::vector<SheetReadings>& sheets_;
  const LightCheckOptions& options_;
  std::vector<bool> used_;
  Task task_;
  RigCheck& check_;
  CheckModel model_;
  SampleWeights weights_;
  ChangeFit fit_;
  ChangeMask mask_;
  std::vector<ChangeGain> gains_;
  Eigen::Vector3d common_ = Eigen::Vector3d::Zero();  // log flux of all lights
};

Status CheckArguments(const Rig& rig, const std::vector<SheetReadings>& sheets) {
  if (!rig.camera) {
    return Fail(ErrorCode::kInvalidArgument,
                "the rig has no camera; calibrate lens and pose first");
  }
  for (const Light& light : rig.lights) {
    if (light.model == LightModel::kDistant) {
      return Fail(ErrorCode::kInvalidArgument,
                  "light '{}' is distant; need its position_mm: calibrate the lights first",
                  light.name);
    }
  }
  return sheets.empty() ? Status(Fail(ErrorCode::kInvalidArgument, "no sheet; need at least one"))
                        : Status();
}

}  // namespace

std::string_view Name(LightVerdict verdict) {
  switch (verdict) {
    case LightVerdict::kHolds:
      return "holds";
    case LightVerdict::kDark:
      return "dark";
    case LightVerdict::kSaturated:
      return "saturated";
    case LightVerdict::kElsewhere:
      return "elsewhere";
    case LightVerdict::kMoved:
      return "moved";
    case LightVerdict::kTurned:
      return "turned";
    case LightVerdict::kDim:
      return "dim";
    case LightVerdict::kBright:
      return "bright";
  }
  return "";
}

Status LightCheckOptions::Validate() const {
  if (!(albedo > 0.0 && albedo <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "albedo = {:g}; need 0 < albedo <= 1", albedo);
  }
  return InRange("max_direction_deg", max_direction_deg, 0.0, 90.0)
      .and_then([&] { return InRange("max_flux_percent", max_flux_percent, 0.0, 100.0); })
      .and_then(
          [&] { return InRange("max_common_flux_percent", max_common_flux_percent, 0.0, 100.0); })
      .and_then([&] { return InRange("max_sheet_deg", max_sheet_deg, 0.0, 45.0); })
      .and_then([&] { return InRange("max_spoilt_percent", max_spoilt_percent, 0.0, 100.0); })
      .and_then([&] { return InRange("significance", significance, 1.99, 100.01); });
}

Result<RigCheck> CheckRig(const Rig& rig, const std::vector<SheetReadings>& sheets,
                          const std::vector<FrameFault>& faults, const LightCheckOptions& options,
                          const Task& task) {
  if (Status status = options.Validate().and_then([&] { return CheckArguments(rig, sheets); });
      !status) {
    return tl::unexpected(status.error());
  }
  RigCheck check;
  check.lights.resize(rig.lights.size());
  std::vector<bool> used(rig.lights.size());
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    LightCheck& light = check.lights[k];
    const bool has_samples = std::ranges::all_of(
        sheets, [&](const SheetReadings& s) { return s.samples[k].size() >= kFewestSamples; });
    if (!has_samples) {
      light.verdict =
          faults[k] == FrameFault::kSaturated ? LightVerdict::kSaturated : LightVerdict::kDark;
    } else if (light.lit_from = LitFrom(rig.lights, sheets[0].samples[k], k); light.lit_from) {
      light.verdict = LightVerdict::kElsewhere;
    }
    used[k] = light.verdict == LightVerdict::kHolds;
    check.holds = check.holds && used[k];
  }
  if (std::ranges::count(used, true) == 0) {
    return Fail(
        ErrorCode::kDegenerate,
        "no light has a frame that can be checked: all are dark, saturated or swapped; did the "
        "lights come on, and is this the rig's sheet?");
  }
  if (Status status = Checker(rig, sheets, options, used, task, check).Run(); !status) {
    return tl::unexpected(status.error());
  }
  return check;
}

}  // namespace sateen
