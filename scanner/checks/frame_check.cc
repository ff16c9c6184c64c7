#include "scanner/checks/frame_check.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "rig/projection.h"
#include "scanner/checks/frame_compare.h"

namespace sateen {
namespace {

constexpr double kFitsAsWell = 5.0;   // times the usual misfit of a frame at its own light
constexpr double kMisleading = 0.02;  // of a frame's light: less looks like nothing but a shadow
constexpr double kDoubled = 1.4;      // a level from which on another light may be on too

using Field = std::vector<double>;  // one value a block

Field BrightnessOf(const FrameLook& look) {
  Field field;
  field.reserve(look.means.blocks.size());
  for (const BlockMean& block : look.means.blocks) {
    field.push_back(block.radiance_rgb.sum());
  }
  return field;
}

double Sum(const Field& field) { return std::accumulate(field.begin(), field.end(), 0.0); }

Field Less(Field field, const Field& other) {
  std::ranges::transform(field, other, field.begin(), std::minus<>());
  return field;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class CaptureChecker {
 public:
  CaptureChecker(const Rig& rig, const CaptureLooks& looks, const FrameCheckOptions& options)
      : rig_(rig), looks_(looks), options_(options) {
    const Field dark = BrightnessOf(*looks.dark_first);
    for (const FrameLook* look : looks.lit) {
      signal_.push_back(Less(BrightnessOf(*look), dark));
    }
    Predict();
  }

  CaptureCheck Check() {
    CheckAmbient();
    check_.drift = Sum(Less(BrightnessOf(*looks_.repeat), BrightnessOf(*looks_.dark_first))) /
                       Sum(signal_[0]) -
                   1.0;
    FindLevels();
    if (!check_.faults.empty()) {
      return std::move(check_);  // what every frame suffers from would look like faults of lights
    }
    FindDark();
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
  // E of (1); of one everywhere where the rig does not say.
  void Predict() {
    const BlockMeans& means = looks_.lit[0]->means;
    const bool has_pose = rig_.camera && rig_.camera->has_pose;
    has_pattern_ = has_pose && std::ranges::any_of(rig_.lights, [](const Light& light) {
                     return light.model != LightModel::kDistant;
                   });
    for (const Light& light : rig_.lights) {
      Field field;
      for (int row = 0; row < means.grid.rows; ++row) {
        for (int column = 0; column < means.grid.columns; ++column) {
          field.push_back(PredictAt(light, means.Center(column, row), has_pose));
        }
      }
      predicted_.push_back(std::move(field));
    }
    if (!has_pattern_) {
      check_.notes.emplace_back(
          has_pose ? "the lights are distant ones, which look alike: swapped lights are not found"
                   : "the rig has no pose of its camera: swapped lights are not found, nor is a "
                     "shadow on one frame");
    }
  }

  double PredictAt(const Light& light, const Eigen::Vector2d& px, bool has_pose) const {
    if (!has_pose && light.model != LightModel::kDistant) {
      return 1.0;
    }
    const std::optional<Eigen::Vector3d> x_mm =
        has_pose ? TablePointOfPixel(*rig_.camera, px.x(), px.y()) : Eigen::Vector3d::Zero();
    if (!x_mm) {
      return 0.0;
    }
    const Incident incident = IncidentAt(light, *x_mm);
    return incident.e_rgb.sum() * std::max(0.0, incident.l.z());
  }

  void CheckAmbient() {
    std::vector<double> sums;
    std::ranges::transform(signal_, std::back_inserter(sums), Sum);
    const double change =
        Sum(Less(BrightnessOf(*looks_.dark_last), BrightnessOf(*looks_.dark_first)));
    check_.ambient = change / std::max(Median(sums), 1e-30);
    if (std::abs(check_.ambient) > options_.max_ambient) {
      check_.faults.push_back(
          {.kind = CaptureFaultKind::kAmbient,
           .text = fmt::format(
               "ambient light has changed by {:+.1f} % of what the lights give, between the dark "
               "frame at the start and the one at the end; at most {:.1f} % may be: keep the room "
               "as it is, and capture every frame again",
               100.0 * check_.ambient, 100.0 * options_.max_ambient)});
    }
  }

  void CheckShifts() {
    check_.shifts = ShiftsOf(rig_, looks_, on_, options_);
    if (check_.shifts.empty()) {
      check_.notes.emplace_back(
          "too little texture to tell whether the camera has moved meanwhile");
    } else if (std::optional<CaptureFault> moved = MovedFault(rig_, check_.shifts, options_)) {
      check_.faults.push_back(*std::move(moved));
    }
  }

  // The one light whose frame alone is said to be another light's, or to have moved and come back:
  // the edge of a shadow can look like both.
  [[nodiscard]] std::optional<size_t> SuspectOf(const CaptureCheck& check) const {
    if (check.faults.size() != 1) {
      return std::nullopt;
    }
    const CaptureFault& fault = check.faults[0];
    return fault.kind == CaptureFaultKind::kOtherLight ? std::optional(fault.lights[0])
           : fault.kind == CaptureFaultKind::kMoved    ? OnlyOneThatMoved(check.shifts, options_)
                                                       : std::nullopt;
  }

  // A shaded light is no other one, nor dim.
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
        AddFault(CaptureFaultKind::kDark, {k},
                 fmt::format("light '{}' was not on: its frame has {:.0f} % of the light that the "
                             "rig says; check its cable: sateen light {}",
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
            fmt::format("light '{}' has {:.0f} % of the light that the rig says, against the "
                        "others; at most {:.0f} % may be between: check the light and what may "
                        "shade it, or calibrate anew",
                        rig_.lights[k].name, 100.0 * level, 100.0 * change));
      }
    }
    for (size_t k = 0; k < signal_.size(); ++k) {
      if (check_.levels[k] > kDoubled) {
        AddFault(CaptureFaultKind::kLevel, {k},
                 fmt::format("light '{}' has {:.0f} % of the light that the rig says{}: more than "
                             "one light was on; check the wiring of its channel {}",
                             rig_.lights[k].name, 100.0 * check_.levels[k], SecondLight(k),
                             rig_.lights[k].channel));
      }
    }
  }

  // Median log of all lights that are on, block by block: one shaded frame must not bend the others.
  [[nodiscard]] Field MedianLog(const std::vector<Field>& all) const {
    Field median;
    for (size_t b = 0; b < all[0].size(); ++b) {
      std::vector<double> logs;
      for (size_t k = 0; k < all.size(); ++k) {
        if (on_[k]) {
          logs.push_back(std::log(std::max(all[k][b], 1e-30)));
        }
      }
      median.push_back(Median(std::move(logs)));
    }
    return median;
  }

  // (3); not finite where a value is not above 0.
  static Field Pattern(Field field, const Field& median_log) {
    std::ranges::transform(field, median_log, field.begin(),
                           [](double value, double median) { return std::log(value) - median; });
    return field;
  }

  // (4), over the blocks where both are known.
  static double Misfit(const Field& q, const Field& r) {
    double sum = 0.0;
    double sum2 = 0.0;
    double count = 0.0;
    for (size_t b = 0; b < q.size(); ++b) {
      const double difference = q[b] - r[b];
      if (std::isfinite(difference)) {
        sum += difference;
        sum2 += difference * difference;
        count += 1.0;
      }
    }
    return count > 0.0 ? sum2 / count - sum / count * (sum / count) : 0.0;
  }

  // ", as if light 'b' were on too", where the pattern tells.
  [[nodiscard]] std::string SecondLight(size_t k) const {
    if (!has_pattern_) {
      return "";
    }
    const Field q = Pattern(signal_[k], MedianLog(signal_));
    const Field median_predicted = MedianLog(predicted_);
    size_t best = k;
    double least = 0.0;
    for (size_t j = 0; j < predicted_.size(); ++j) {
      Field both = predicted_[k];
      std::ranges::transform(both, predicted_[j], both.begin(), std::plus<>());
      const double misfit = Misfit(q, Pattern(both, median_predicted));
      if (j != k && (best == k || misfit < least)) {
        best = j;
        least = misfit;
      }
    }
    return best == k ? "" : fmt::format(", as if light '{}' were on too", rig_.lights[best].name);
  }

  // Misfit (4) of a frame at its own light, and at the light where it is least.
  struct Fit {
    double own = 0.0;
    double least = 0.0;
    size_t best = 0;
  };

  static Fit FitOf(size_t k, const Field& q, const std::vector<Field>& patterns) {
    const double own = Misfit(q, patterns[k]);
    Fit fit{.own = own, .least = own, .best = k};
    for (size_t j = 0; j < patterns.size(); ++j) {
      const double misfit = Misfit(q, patterns[j]);
      if (misfit < fit.least) {
        fit.best = j;
        fit.least = misfit;
      }
    }
    return fit;
  }

  void CheckPatterns() {
    if (!has_pattern_ || std::ranges::count(on_, true) < 2) {
      return;
    }
    const Field median_signal = MedianLog(signal_);
    const Field median_predicted = MedianLog(predicted_);
    std::vector<Field> patterns;
    for (const Field& field : predicted_) {
      patterns.push_back(Pattern(field, median_predicted));
    }
    std::vector<Fit> fits(signal_.size());
    std::vector<double> own;
    for (size_t k = 0; k < signal_.size(); ++k) {
      if (on_[k]) {
        fits[k] = FitOf(k, Pattern(signal_[k], median_signal), patterns);
        own.push_back(fits[k].own);
      }
    }
    const double usual = Median(own);
    for (size_t k = 0; k < signal_.size(); ++k) {
      const Fit& fit = fits[k];
      // A shaded frame fits no light; a frame of another light fits that one as well as others theirs.
      if (on_[k] && fit.best != k && fit.least < options_.other_light_misfit * fit.own &&
          fit.least < kFitsAsWell * usual) {
        AddFault(
            CaptureFaultKind::kOtherLight, {k},
            fmt::format("the frame of light '{}' is lit from where the rig has light '{}'; are "
                        "they swapped? Check the channels of both ({} and {})",
                        rig_.lights[k].name, rig_.lights[fit.best].name, rig_.lights[k].channel,
                        rig_.lights[fit.best].channel));
      }
    }
  }

  const Rig& rig_;
  const CaptureLooks& looks_;
  const FrameCheckOptions& options_;
  bool has_pattern_ = false;
  std::vector<Field> signal_;     // s of (1)
  std::vector<Field> predicted_;  // E of (1)
  std::vector<bool> on_;          // one light, alone
  std::vector<bool> is_explained_;
  CaptureCheck check_;
};

}  // namespace

Status FrameCheckOptions::Validate() const {
  struct Range {
    const char* name;
    double value;
    double most;
  };
  for (const auto& [name, value, most] :
       {Range{"max_saturated", max_saturated, 1.0}, Range{"min_level", min_level, 1.0},
        Range{"max_level_change", max_level_change, 1.0},
        Range{"max_rough_level_change", max_rough_level_change, 1.0},
        Range{"other_light_misfit", other_light_misfit, 1.0},
        Range{"max_ambient", max_ambient, 1.0}, Range{"max_drift", max_drift, 1.0},
        Range{"max_shift_px", max_shift_px, 100.0}, Range{"min_shift_peak", min_shift_peak, 1.0},
        Range{"min_shade", min_shade, 1.0}, Range{"max_exposure_error", max_exposure_error, 1.0}}) {
    if (!(value > 0.0 && value <= most)) {
      return Fail(ErrorCode::kInvalidArgument, "{} is {}; need more than 0 and at most {:g}", name,
                  value, most);
    }
  }
  return {};
}

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
