#include "simulation/weave.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace sateen {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kMeanSamples = 240;  // along a side of the repeat

// Section of a yarn, equation (1) without its centre line.
struct Section {
  double half_width_mm;
  double radius_mm;
  double edge_mm;  // r cos e
  double edge_slope;

  Section(double half_width, double edge_rad)
      : half_width_mm(half_width),
        radius_mm(half_width / std::sin(edge_rad)),
        edge_mm(radius_mm * std::cos(edge_rad)),
        edge_slope(std::tan(edge_rad)) {}

  [[nodiscard]] double TopMm() const { return radius_mm - edge_mm; }
};

// Height and slope of a yarn along itself and across.
struct YarnPoint {
  double height_mm;
  double along;
  double across;
};

YarnPoint OnYarn(const Section& section, double center_mm, double center_slope, double d) {
  const double beyond = std::abs(d) - section.half_width_mm;
  if (beyond > 0.0) {
    return {center_mm - beyond * section.edge_slope, center_slope,
            -std::copysign(section.edge_slope, d)};
  }
  const double root = std::sqrt(section.radius_mm * section.radius_mm - d * d);
  return {center_mm + root - section.edge_mm, center_slope, -d / root};
}

void Raise(SurfacePoint& seen, const SurfacePoint& candidate) {
  if (candidate.height_mm > seen.height_mm) {
    seen = candidate;
  }
}

int Modulo(int i, int n) { return ((i % n) + n) % n; }

// Returns true if warp yarn i lies over weft yarn j.
bool WarpIsOver(WeavePattern pattern, int i, int j) {
  switch (pattern) {
    case WeavePattern::kTwill:
      return Modulo(i - j, 4) < 2;
    case WeavePattern::kSatin:
      return Modulo(2 * i + j, 5) != 0;
    case WeavePattern::kRib:
      return Modulo(i + static_cast<int>(std::floor(j / 2.0)), 2) == 0;
    default:
      return Modulo(i + j, 2) == 0;
  }
}

// Returns the length of a pattern's repeat, in pitches.
int RepeatOf(WeavePattern pattern) {
  switch (pattern) {
    case WeavePattern::kSatin:
      return 5;
    case WeavePattern::kTwill:
    case WeavePattern::kRib:
      return 4;
    default:
      return 2;
  }
}

// A surface whose mean height over a square of `repeat_mm` is taken off.
class Textile : public Surface {
 public:
  [[nodiscard]] SurfacePoint At(double x_mm, double y_mm) const final {
    SurfacePoint point = Raw(x_mm, y_mm);
    point.height_mm -= mean_mm_;
    return point;
  }
  [[nodiscard]] double LowestMm() const final { return ground_mm_ - mean_mm_; }
  [[nodiscard]] double HighestMm() const final { return top_mm_ - mean_mm_; }
  [[nodiscard]] double MaxSlope() const final { return max_slope_; }
  [[nodiscard]] double DetailMm() const final { return detail_mm_; }

 protected:
  [[nodiscard]] virtual SurfacePoint Raw(double x_mm, double y_mm) const = 0;
  void SetBounds(double ground_mm, double top_mm, double max_slope, double detail_mm) {
    ground_mm_ = ground_mm;
    top_mm_ = top_mm;
    max_slope_ = max_slope;
    detail_mm_ = detail_mm;
  }
  void CenterOver(double width_mm, double height_mm) {
    double sum = 0.0;
    for (int j = 0; j < kMeanSamples; ++j) {
      for (int i = 0; i < kMeanSamples; ++i) {
        sum += Raw((i + 0.5) / kMeanSamples * width_mm, (j + 0.5) / kMeanSamples * height_mm)
                   .height_mm;
      }
    }
    mean_mm_ = sum / (kMeanSamples * kMeanSamples);
  }
  [[nodiscard]] double GroundMm() const { return ground_mm_; }

 private:
  double mean_mm_ = 0.0;
  double ground_mm_ = 0.0;
  double top_mm_ = 0.0;
  double max_slope_ = 0.0;
  double detail_mm_ = 1.0;
};

class Weave final : public Textile {
 public:
  explicit Weave(const WeaveSpec& spec)
      : spec_(spec), section_(0.5 * spec.fill * spec.pitch_mm, spec.edge_rad) {
    const double along = 0.5 * kPi * spec.amplitude_mm / (0.5 * spec.pitch_mm);
    SetBounds(-spec.amplitude_mm, spec.amplitude_mm + section_.TopMm(),
              std::hypot(std::tan(spec.edge_rad), along), 0.5 * spec.pitch_mm);
    const double repeat_mm = RepeatOf(spec.pattern) * spec.pitch_mm;
    CenterOver(repeat_mm, repeat_mm);
  }
  [[nodiscard]] std::vector<std::string_view> Parts() const override {
    return {"warp", "weft", "ground"};
  }

 protected:
  [[nodiscard]] SurfacePoint Raw(double x_mm, double y_mm) const override {
    const double u = x_mm / spec_.pitch_mm;
    const double v = y_mm / spec_.pitch_mm;
    const int i = static_cast<int>(std::floor(u));
    const int j = static_cast<int>(std::floor(v));
    SurfacePoint seen{.height_mm = GroundMm(), .part = 2};
    // The yarn below or above this place and the next one on its nearer side.
    for (const int warp : {i, u - i < 0.5 ? i - 1 : i + 1}) {
      const YarnPoint p = Yarn(v, (u - warp - 0.5) * spec_.pitch_mm, [&](int crossing) {
        return WarpIsOver(spec_.pattern, warp, crossing);
      });
      Raise(seen, {p.height_mm, {p.across, p.along}, 0, warp});
    }
    for (const int weft : {j, v - j < 0.5 ? j - 1 : j + 1}) {
      const YarnPoint p = Yarn(u, (v - weft - 0.5) * spec_.pitch_mm, [&](int crossing) {
        return !WarpIsOver(spec_.pattern, crossing, weft);
      });
      Raise(seen, {p.height_mm, {p.along, p.across}, 1, weft});
    }
    return seen;
  }

 private:
  // `s` in pitches along the yarn; crossings lie at whole numbers plus a half.
  template <typename IsOver>
  [[nodiscard]] YarnPoint Yarn(double s, double d, const IsOver& is_over) const {
    const int before = static_cast<int>(std::floor(s - 0.5));
    const double from = is_over(before) ? spec_.amplitude_mm : -spec_.amplitude_mm;
    const double to = is_over(before + 1) ? spec_.amplitude_mm : -spec_.amplitude_mm;
    const double phase = kPi * (s - 0.5 - before);
    return OnYarn(section_, 0.5 * (from + to) + 0.5 * (from - to) * std::cos(phase),
                  -0.5 * (from - to) * std::sin(phase) * kPi / spec_.pitch_mm, d);
  }

  WeaveSpec spec_;
  Section section_;
};

// Jersey: in every cell of a column two legs lean outwards as they go up; a leg dives at both ends
// below its neighbours above and below.
class Knit final : public Textile {
 public:
  explicit Knit(const WeaveSpec& spec)
      : spec_(spec),
        course_mm_(kCourse * spec.pitch_mm),
        lean_((kTopPlace - kBottomPlace) / kCourse),
        cos_lean_(1.0 / std::hypot(1.0, lean_)),
        section_(0.5 * kYarnWidth * spec.fill * spec.pitch_mm, spec.edge_rad) {
    const double along = spec.amplitude_mm * 2.0 * kPi / (kSpan * course_mm_);
    SetBounds(-2.0 * spec.amplitude_mm, spec.amplitude_mm + section_.TopMm(),
              section_.edge_slope + std::max(section_.edge_slope, along), section_.half_width_mm);
    CenterOver(spec.pitch_mm, course_mm_);
  }
  [[nodiscard]] std::vector<std::string_view> Parts() const override { return {"yarn", "ground"}; }

 protected:
  [[nodiscard]] SurfacePoint Raw(double x_mm, double y_mm) const override {
    const int column = static_cast<int>(std::floor(x_mm / spec_.pitch_mm));
    const int course = static_cast<int>(std::floor(y_mm / course_mm_));
    const double u = x_mm - (column + 0.5) * spec_.pitch_mm;  // from the column's middle [mm]
    SurfacePoint seen{.height_mm = GroundMm(), .part = 1};
    for (int c = course - 2; c <= course + 2; ++c) {
      for (const int beside : {-1, 0, 1}) {
        for (const double side : {-1.0, 1.0}) {
          RaiseLeg(u - beside * spec_.pitch_mm, y_mm / course_mm_ - c, side, column + beside, seen);
        }
      }
    }
    return seen;
  }

 private:
  static constexpr double kCourse = 0.8;       // height of a loop over the column's pitch
  static constexpr double kYarnWidth = 0.46;   // at fill 1
  static constexpr double kBottomPlace = 0.1;  // distance of a leg from the middle, in pitches
  static constexpr double kTopPlace = 0.32;
  static constexpr double kSpan = 1.7;  // length of a leg in loops

  void RaiseLeg(double u, double v, double side, int column, SurfacePoint& seen) const {
    const double middle = v - 0.5;
    const double beyond = std::max(0.0, std::abs(middle) - 0.5 * kSpan) * course_mm_;
    const double phase = 2.0 * kPi * std::clamp(middle / kSpan, -0.5, 0.5);
    const double height = spec_.amplitude_mm * std::cos(phase) - beyond * section_.edge_slope;
    if (height + section_.TopMm() <= seen.height_mm) {
      return;
    }
    const double slope =
        beyond > 0.0 ? -std::copysign(section_.edge_slope, middle)
                     : -spec_.amplitude_mm * std::sin(phase) * 2.0 * kPi / (kSpan * course_mm_);
    const double center = side * spec_.pitch_mm * (kBottomPlace + (kTopPlace - kBottomPlace) * v);
    const YarnPoint p = OnYarn(section_, height, slope, (u - center) * cos_lean_);
    // d = (u - u0 - side lean y) cos(lean); the centre line's height depends on y alone.
    Raise(seen, {p.height_mm,
                 {p.across * cos_lean_, p.along - p.across * cos_lean_ * side * lean_},
                 0,
                 column});
  }

  WeaveSpec spec_;
  double course_mm_;
  double lean_;
  double cos_lean_;
  Section section_;
};

}  // namespace

std::optional<WeavePattern> WeavePatternNamed(std::string_view name) {
  constexpr std::array<std::string_view, 5> kNames = {"plain", "twill", "satin", "rib", "knit"};
  const auto* const found = std::ranges::find(kNames, name);
  if (found == kNames.end()) {
    return std::nullopt;
  }
  return static_cast<WeavePattern>(found - kNames.begin());
}

Status WeaveSpec::Validate() const {
  const auto fail = [](std::string_view field, double value, std::string_view range) {
    return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", field, value, range);
  };
  if (!(pitch_mm >= 1e-3 && pitch_mm <= 1e6)) {
    return fail("pitch_mm", pitch_mm, "0.001 to 1e6");
  }
  if (!(fill > 0.0 && fill <= 1.0)) {
    return fail("fill", fill, "0 < fill <= 1");
  }
  if (!(edge_rad > 0.0 && edge_rad < kPi / 2.0)) {
    return fail("edge_rad", edge_rad, "0 < edge_rad < pi/2");
  }
  if (!(amplitude_mm >= 0.0 && std::isfinite(amplitude_mm))) {
    return fail("amplitude_mm", amplitude_mm, "amplitude_mm >= 0");
  }
  const double half_width_mm = 0.5 * fill * pitch_mm;
  const double most_mm = 0.5 * ((pitch_mm - half_width_mm) * std::tan(edge_rad) +
                                Section(half_width_mm, edge_rad).TopMm());
  if (amplitude_mm > most_mm) {
    return fail("amplitude_mm", amplitude_mm,
                fmt::format("at most {:.3g} mm, where the flank of one yarn reaches the middle of "
                            "the next",
                            most_mm));
  }
  return {};
}

Result<SurfacePtr> MakeWeave(const WeaveSpec& spec) {
  if (Status status = spec.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  if (spec.pattern == WeavePattern::kKnit) {
    return std::make_unique<Knit>(spec);
  }
  return std::make_unique<Weave>(spec);
}

}  // namespace sateen
