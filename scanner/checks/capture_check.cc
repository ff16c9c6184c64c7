#include "scanner/checks/capture_check.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "core/statistics.h"
#include "rig/projection.h"
#include "scanner/checks/frame_compare.h"
#include "scanner/checks/light_patterns.h"

namespace sateen {
namespace {

constexpr double kFitsAsWell = 5.0;   // times the usual misfit of a frame at its own light
constexpr double kMisleading = 0.02;  // share of a frame's light: less looks like a shadow alone
constexpr double kDoubled = 1.4;      // a level from which on another light may be on too

BlockField BrightnessOf(const FrameLook& look) {
  BlockField field;
  field.reserve(look.means.blocks.size());
  for (const BlockMean& block : look.means.blocks) {
    field.push_back(block.radiance_rgb.sum());
  }
  return field;
}

double Sum(const BlockField& field) { return std::accumulate(field.begin(), field.end(), 0.0); }

BlockField Less(BlockField field, const BlockField& other) {
  std::ranges::transform(field, other, field.begin(), std::minus<>());
  return field;
}

class CaptureChecker {
 public:
  CaptureChecker(const Rig& rig, const CaptureLooks& looks, const FrameCheckOptions& options)
      : rig_(rig), looks_(looks), options_(options) {
    const BlockField dark = BrightnessOf(looks.dark_first);
    for (const FrameLook& look : looks.lit) {
      signal_.push_back(Less(BrightnessOf(look), dark));
    }
    Predict();
  }

  CaptureCheck Check() {
    CheckAmbient();
    check_.drift =
        Sum(Less(BrightnessOf(looks_.repeat), BrightnessOf(looks_.dark_first))) / Sum(signal_[0]) -
        1.0;
    FindLevels();
    if (!check_.faults.empty()) {
      return std::move(check_);  // a fault of every frame would look like faults of lights
    }
    FindDark();
    if (has_pattern_) {
      patterns_.emplace(signal_, predicted_, on_);
    }
    CheckPatterns();
    if (check_.faults.empty()) {
      CheckShifts();
    }
    if (check_.faults.empty() || SuspectOf(check_)) {
      CheckShades();
    }
    CheckLevels();
    if (check_.faults.empty() && std::abs(check_.drift) > options_.max_drift) {
      check_.notes.push_back(fmt::format(
          "light '{}' is {:+.1f} % brighter at the end than at the start; let the lights warm up",
          rig_.lights[0].name, 100.0 * check_.drift));
    }
    return std::move(check_);
  }

 private:
  // Computes E of (1): 1 everywhere where the rig does not say.
  void Predict() {
    const BlockMeans& means = looks_.lit[0].means;
    const bool has_pose = rig_.camera && rig_.camera->has_pose;
    has_pattern_ = has_pose && std::ranges::any_of(rig_.lights, [](const Light& light) {
                     return light.model != LightModel::kDistant;
                   });
    for (const Light& light : rig_.lights) {
      BlockField field;
      for (int row = 0; row < means.grid.rows; ++row) {
        for (int column = 0; column < means.grid.columns; ++column) {
          field.push_back(PredictAt(light, means.Center(column, row), has_pose));
        }
      }
      predicted_.push_back(std::move(field));
    }
    if (!has_pattern_) {
      check_.notes.emplace_back(
          has_pose
              ? "the lights are distant and look alike: swapped lights are not found"
              : "the rig's camera has no pose: swapped lights are not found, nor are shadows on "
                "one frame");
    }
  }

  double PredictAt(const Light& light, const Eigen::Vector2d& px, bool has_pose) const {
    if (!has_pose && light.model != LightModel::kDistant) {
      return 1.0;
    }
    return std::max(0.0, LightAtPixel(rig_, light, px).z());
  }

  void CheckAmbient() {
    std::vector<double> sums;
    std::ranges::transform(signal_, std::back_inserter(sums), Sum);
    const double change =
        Sum(Less(BrightnessOf(looks_.dark_last), BrightnessOf(looks_.dark_first)));
    check_.ambient = change / std::max(Median(sums), 1e-30);
    if (std::abs(check_.ambient) > options_.max_ambient) {
      check_.faults.push_back(
          {.kind = CaptureFaultKind::kAmbient,
           .text = fmt::format(
               "ambient light changed by {:+.1f} % of the lights' brightness between the first and "
               "the last dark frame, more than {:.1f} %; keep the room light constant and capture "
               "every frame again",
               100.0 * check_.ambient, 100.0 * options_.max_ambient)});
    }
  }

  void CheckShifts() {
    check_.shifts = ShiftsOf(rig_, looks_, on_, options_);
    if (check_.shifts.empty()) {
      check_.notes.emplace_back("too little texture to tell whether the camera moved");
    } else if (std::optional<CaptureFault> moved = MovedFault(rig_, check_.shifts, options_)) {
      check_.faults.push_back(*std::move(moved));
    }
  }

  // Returns the light if one frame alone seems to be another light's, or to have moved and come
  // back: the edge of a shadow can look like both.
  [[nodiscard]] std::optional<size_t> SuspectOf(const CaptureCheck& check) const {
    if (check.faults.size() != 1) {
      return std::nullopt;
    }
    const CaptureFault& fault = check.faults[0];
    return fault.kind == CaptureFaultKind::kOtherLight ? std::optional(fault.lights[0])
           : fault.kind == CaptureFaultKind::kMoved    ? OnlyOneThatMoved(check.shifts, options_)
                                                       : std::nullopt;
  }

  // Adds shaded lights. A frame that a shadow explains is neither another light's nor dim.
  void CheckShades() {
    const std::optional<size_t> suspect = SuspectOf(check_);
    std::vector<CaptureFault> shaded =
        ShadedFaults(rig_, looks_, signal_, on_, options_, suspect ? kMisleading : 0.0);
    if (suspect) {
      const bool explained = std::ranges::any_of(shaded, [&](const CaptureFault& fault) {
        return fault.kind == CaptureFaultKind::kShaded && fault.lights[0] == *suspect;
      });
      if (!explained) {
        return;
      }
      check_.faults.clear();
    }
    for (CaptureFault& fault : shaded) {
      is_explained_[fault.lights[0]] = true;
      check_.faults.push_back(std::move(fault));
    }
  }

  void FindLevels() {  // (2)
    for (size_t k = 0; k < signal_.size(); ++k) {
      check_.levels.push_back(Sum(signal_[k]) / std::max(Sum(predicted_[k]), 1e-30));
    }
    const double median = Median(check_.levels);
    for (double& level : check_.levels) {
      level /= std::max(median, 1e-30);
    }
  }

  void AddFault(CaptureFaultKind kind, std::vector<size_t> lights, std::string text) {
    check_.faults.push_back({.kind = kind, .lights = std::move(lights), .text = std::move(text)});
  }

  void FindDark() {
    on_.assign(signal_.size(), true);
    is_explained_.assign(signal_.size(), false);
    for (size_t k = 0; k < signal_.size(); ++k) {
      const double level = check_.levels[k];
      if (!(level >= options_.min_level)) {  // also NaN
        on_[k] = false;
        AddFault(
            CaptureFaultKind::kDark, {k},
            fmt::format("light '{}' was off: its frame has {:.0f} % of the brightness that the "
                        "rig predicts; check its cable: sateen light {}",
                        rig_.lights[k].name, 100.0 * level, rig_.lights[k].channel));
      } else if (level > kDoubled) {
        on_[k] = false;
      }
    }
  }

  void CheckLevels() {
    const double change =
        rig_.calibration.lights ? options_.max_level_change : options_.max_rough_level_change;
    for (size_t k = 0; k < signal_.size(); ++k) {
      const double level = check_.levels[k];
      if (on_[k] && !is_explained_[k] && std::abs(level - 1.0) > change) {
        AddFault(
            CaptureFaultKind::kLevel, {k},
            fmt::format("light '{}' has {:.0f} % of its brightness relative to the calibration, a "
                        "change of more than {:.0f} %; check the light and what may shade it, or "
                        "calibrate again",
                        rig_.lights[k].name, 100.0 * level, 100.0 * change));
      }
    }
    for (size_t k = 0; k < signal_.size(); ++k) {
      if (check_.levels[k] > kDoubled) {
        AddFault(CaptureFaultKind::kLevel, {k},
                 fmt::format("light '{}' has {:.0f} % of the brightness that the rig predicts{}: "
                             "more than one light was on; check the wiring of its channel {}",
                             rig_.lights[k].name, 100.0 * check_.levels[k], SecondLight(k),
                             rig_.lights[k].channel));
      }
    }
  }

  // Returns ", as if light 'b' were on too" where the pattern tells.
  [[nodiscard]] std::string SecondLight(size_t k) const {
    const std::optional<size_t> second = patterns_ ? patterns_->SecondLight(k) : std::nullopt;
    return second ? fmt::format(", as if light '{}' were on too", rig_.lights[*second].name) : "";
  }

  void CheckPatterns() {
    if (!patterns_ || std::ranges::count(on_, true) < 2) {
      return;
    }
    std::vector<LightPatterns::Fit> fits(signal_.size());
    std::vector<double> own;
    for (size_t k = 0; k < signal_.size(); ++k) {
      if (on_[k]) {
        fits[k] = patterns_->FitOf(k);
        own.push_back(fits[k].own);
      }
    }
    const double usual = Median(own);
    for (size_t k = 0; k < signal_.size(); ++k) {
      const LightPatterns::Fit& fit = fits[k];
      // A shaded frame fits no light. A frame of another light fits that light as well as other
      // frames fit theirs.
      if (on_[k] && fit.best != k && fit.least < options_.other_light_misfit * fit.own &&
          fit.least < kFitsAsWell * usual) {
        check_.faults.push_back(OtherLightFault(rig_, k, fit.best));
      }
    }
  }

  const Rig& rig_;
  const CaptureLooks& looks_;
  const FrameCheckOptions& options_;
  bool has_pattern_ = false;
  std::vector<BlockField> signal_;     // s of (1)
  std::vector<BlockField> predicted_;  // E of (1)
  std::vector<bool> on_;               // one light, alone
  std::vector<bool> is_explained_;
  std::optional<LightPatterns> patterns_;  // where the rig tells lights apart
  CaptureCheck check_;
};

}  // namespace

CaptureCheck CheckCapture(const Rig& rig, const CaptureLooks& looks,
                          const FrameCheckOptions& options) {
  return CaptureChecker(rig, looks, options).Check();
}

void RecordShifts(const CaptureCheck& check, const Rig& rig, Session& session) {
  for (SessionFrame& frame : session.frames) {
    const auto light = std::ranges::find(rig.lights, frame.light, &Light::name);
    const auto k = static_cast<size_t>(light - rig.lights.begin());
    frame.shift_px.reset();
    if (frame.role == FrameRole::kLit && k + 1 < check.shifts.size() &&
        IsSignificant(check.shifts[k])) {
      frame.shift_px = (check.shifts[k].px * 1000.0).array().round() / 1000.0;
    }
  }
}

}  // namespace sateen
