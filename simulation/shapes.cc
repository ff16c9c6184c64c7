#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "simulation/surface.h"

namespace sateen {
namespace {

constexpr double kHalfPi = std::numbers::pi / 2.0;

[[nodiscard]] tl::unexpected<Error> OutOfRange(std::string_view field, double value,
                                               std::string_view range) {
  return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", field, value, range);
}

constexpr double kMostLengthMm = 1e7;

bool IsLength(double value_mm) { return value_mm > 0.0 && value_mm <= kMostLengthMm; }

class Plane final : public Surface {
 public:
  Plane(const Eigen::Vector2d& slope, double height_mm) : slope_(slope), height_mm_(height_mm) {}
  [[nodiscard]] SurfacePoint At(double x_mm, double y_mm) const override {
    return {.height_mm = height_mm_ + slope_.dot(Eigen::Vector2d(x_mm, y_mm)), .slope = slope_};
  }
  [[nodiscard]] double LowestMm() const override {
    return slope_.isZero() ? height_mm_ : -std::numeric_limits<double>::infinity();
  }
  [[nodiscard]] double HighestMm() const override {
    return slope_.isZero() ? height_mm_ : std::numeric_limits<double>::infinity();
  }
  [[nodiscard]] double MaxSlope() const override { return slope_.norm(); }
  [[nodiscard]] double DetailMm() const override { return 1.0; }
  [[nodiscard]] bool IsPlane() const override { return true; }

 private:
  Eigen::Vector2d slope_;
  double height_mm_;
};

class SphereCap final : public Surface {
 public:
  SphereCap(double radius_mm, double edge_rad)
      : radius_mm_(radius_mm), edge_rad_(edge_rad), base_mm_(radius_mm * std::cos(edge_rad)) {}
  [[nodiscard]] SurfacePoint At(double x_mm, double y_mm) const override {
    const double r2 = x_mm * x_mm + y_mm * y_mm;
    const double z = std::sqrt(std::max(radius_mm_ * radius_mm_ - r2, 0.0));
    if (z <= base_mm_) {
      return {};
    }
    return {.height_mm = z - base_mm_, .slope = Eigen::Vector2d(-x_mm / z, -y_mm / z)};
  }
  [[nodiscard]] double LowestMm() const override { return 0.0; }
  [[nodiscard]] double HighestMm() const override { return radius_mm_ - base_mm_; }
  [[nodiscard]] double MaxSlope() const override { return std::tan(edge_rad_); }
  [[nodiscard]] double DetailMm() const override { return radius_mm_; }

 private:
  double radius_mm_;
  double edge_rad_;
  double base_mm_;  // height of the table plane above the centre
};

class Groove final : public Surface {
 public:
  Groove(double depth_mm, double opening_rad)
      : depth_mm_(depth_mm), steepness_(1.0 / std::tan(opening_rad / 2.0)) {}
  [[nodiscard]] SurfacePoint At(double x_mm, double /*y_mm*/) const override {
    const double z = std::abs(x_mm) * steepness_ - depth_mm_;
    if (z >= 0.0) {
      return {};
    }
    return {.height_mm = z, .slope = Eigen::Vector2d(std::copysign(steepness_, x_mm), 0.0)};
  }
  [[nodiscard]] double LowestMm() const override { return -depth_mm_; }
  [[nodiscard]] double HighestMm() const override { return 0.0; }
  [[nodiscard]] double MaxSlope() const override { return steepness_; }
  [[nodiscard]] double DetailMm() const override {
    return std::min(depth_mm_, depth_mm_ / steepness_);
  }

 private:
  double depth_mm_;
  double steepness_;
};

class Steps final : public Surface {
 public:
  Steps(int count, double tread_mm, double rise_mm, double riser_mm)
      : count_(count), tread_mm_(tread_mm), rise_mm_(rise_mm), riser_mm_(riser_mm) {}
  [[nodiscard]] SurfacePoint At(double x_mm, double /*y_mm*/) const override {
    // The risers are centred on the table: riser i starts at (i - (count - 1) / 2) treads.
    const double place = x_mm / tread_mm_ + 0.5 * (count_ - 1);
    const double index = std::floor(place);
    if (index < 0.0) {
      return {};
    }
    if (index >= count_) {
      return {.height_mm = count_ * rise_mm_};
    }
    const double into_riser = (place - index) * tread_mm_ / riser_mm_;
    if (into_riser >= 1.0) {
      return {.height_mm = (index + 1.0) * rise_mm_};
    }
    return {.height_mm = (index + into_riser) * rise_mm_,
            .slope = Eigen::Vector2d(rise_mm_ / riser_mm_, 0.0)};
  }
  [[nodiscard]] double LowestMm() const override { return 0.0; }
  [[nodiscard]] double HighestMm() const override { return count_ * rise_mm_; }
  [[nodiscard]] double MaxSlope() const override { return rise_mm_ / riser_mm_; }
  [[nodiscard]] double DetailMm() const override { return std::min(riser_mm_, rise_mm_); }

 private:
  int count_;
  double tread_mm_;
  double rise_mm_;
  double riser_mm_;
};

class Waves final : public Surface {
 public:
  Waves(double period_mm, double max_slope_rad)
      : k_(2.0 * std::numbers::pi / period_mm),
        amplitude_mm_(std::tan(max_slope_rad) / (std::numbers::sqrt2 * k_)),
        max_slope_(std::tan(max_slope_rad)) {}
  [[nodiscard]] SurfacePoint At(double x_mm, double y_mm) const override {
    return {
        .height_mm = amplitude_mm_ * (std::sin(k_ * x_mm) + std::sin(k_ * y_mm)),
        .slope = amplitude_mm_ * k_ * Eigen::Vector2d(std::cos(k_ * x_mm), std::cos(k_ * y_mm))};
  }
  [[nodiscard]] double LowestMm() const override { return -2.0 * amplitude_mm_; }
  [[nodiscard]] double HighestMm() const override { return 2.0 * amplitude_mm_; }
  [[nodiscard]] double MaxSlope() const override { return max_slope_; }
  [[nodiscard]] double DetailMm() const override { return 1.0 / k_; }

 private:
  double k_;  // [1/mm]
  double amplitude_mm_;
  double max_slope_;
};

}  // namespace

Eigen::Vector3d SurfacePoint::Normal() const {
  return Eigen::Vector3d(-slope.x(), -slope.y(), 1.0).normalized();
}

Result<SurfacePtr> MakePlane(double slope_rad, double azimuth_rad, double height_mm) {
  if (!(slope_rad >= 0.0 && slope_rad < kHalfPi)) {
    return OutOfRange("slope_rad", slope_rad, "0 <= slope_rad < pi/2");
  }
  if (!std::isfinite(azimuth_rad)) {
    return OutOfRange("azimuth_rad", azimuth_rad, "a finite angle");
  }
  if (!std::isfinite(height_mm)) {
    return OutOfRange("height_mm", height_mm, "a finite length");
  }
  return std::make_unique<Plane>(
      std::tan(slope_rad) * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)),
      height_mm);
}

Result<SurfacePtr> MakeSphereCap(double radius_mm, double edge_rad) {
  if (!IsLength(radius_mm)) {
    return OutOfRange("radius_mm", radius_mm, "radius_mm > 0 and at most 1e7");
  }
  if (!(edge_rad > 0.0 && edge_rad < kHalfPi)) {
    return OutOfRange("edge_rad", edge_rad, "0 < edge_rad < pi/2");
  }
  return std::make_unique<SphereCap>(radius_mm, edge_rad);
}

Result<SurfacePtr> MakeGroove(double depth_mm, double opening_rad) {
  if (!IsLength(depth_mm)) {
    return OutOfRange("depth_mm", depth_mm, "depth_mm > 0 and at most 1e7");
  }
  if (!(opening_rad > 0.0 && opening_rad < std::numbers::pi)) {
    return OutOfRange("opening_rad", opening_rad, "0 < opening_rad < pi");
  }
  return std::make_unique<Groove>(depth_mm, opening_rad);
}

Result<SurfacePtr> MakeSteps(int count, double tread_mm, double rise_mm, double riser_mm) {
  if (count < 1 || count > 10000) {
    return OutOfRange("count", count, "1 to 10000");
  }
  if (!IsLength(tread_mm)) {
    return OutOfRange("tread_mm", tread_mm, "tread_mm > 0 and at most 1e7");
  }
  if (!IsLength(rise_mm)) {
    return OutOfRange("rise_mm", rise_mm, "rise_mm > 0 and at most 1e7");
  }
  if (!(riser_mm > 0.0 && riser_mm <= tread_mm)) {
    return OutOfRange("riser_mm", riser_mm, "0 < riser_mm <= tread_mm");
  }
  return std::make_unique<Steps>(count, tread_mm, rise_mm, riser_mm);
}

Result<SurfacePtr> MakeWaves(double period_mm, double max_slope_rad) {
  if (!IsLength(period_mm)) {
    return OutOfRange("period_mm", period_mm, "period_mm > 0 and at most 1e7");
  }
  if (!(max_slope_rad >= 0.0 && max_slope_rad < kHalfPi)) {
    return OutOfRange("max_slope_rad", max_slope_rad, "0 <= max_slope_rad < pi/2");
  }
  return std::make_unique<Waves>(period_mm, max_slope_rad);
}

}  // namespace sateen
