#include "calibration/sheet/flatness.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/angle.h"
#include "core/linear_algebra.h"
#include "core/statistics.h"
#include "imaging/color.h"

namespace sateen {
namespace {

constexpr size_t kFewestLightsSeen = 3;
constexpr double kLeastFilled = 0.25;  // of the number of blocks in the fullest tile

double LuminanceOf(const Eigen::Vector3d& rgb) {
  return rgb.dot(Eigen::Vector3d(static_cast<double>(kLuminance[0]),
                                 static_cast<double>(kLuminance[1]),
                                 static_cast<double>(kLuminance[2])));
}

// Normal equations (1) of one block.
struct BlockNormal {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();  // sum of l l^T
  Eigen::Vector3d b = Eigen::Vector3d::Zero();  // sum of l i'
  size_t lights = 0;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();

  void Add(const SheetSample& sample, const Incident& in) {
    if (!(in.e_rgb.minCoeff() > 0.0)) {
      return;  // behind the light, or without a known intensity
    }
    const double scaled = LuminanceOf(sample.radiance_rgb.cwiseQuotient(in.e_rgb));
    a += in.l * in.l.transpose();
    b += in.l * scaled;
    point_mm = sample.point_mm;
    normal = sample.normal;
    ++lights;
  }

  // Returns the solved normal less that of the sheet; nothing where too few lights are seen.
  [[nodiscard]] std::optional<Eigen::Vector3d> Deviation() const {
    if (lights < kFewestLightsSeen) {
      return std::nullopt;
    }
    const Eigen::Vector3d n = SolveSymmetric(a, b).normalized();
    return n.allFinite() ? std::optional<Eigen::Vector3d>(n - normal) : std::nullopt;
  }
};

std::vector<BlockNormal> SystemsOf(const SheetReadings& sheet, const IncidentOf& incident) {
  std::vector<BlockNormal> systems(static_cast<size_t>(sheet.columns) *
                                   static_cast<size_t>(sheet.rows));
  for (size_t k = 0; k < sheet.samples.size(); ++k) {
    for (size_t i = 0; i < sheet.samples[k].size(); ++i) {
      systems[static_cast<size_t>(sheet.blocks[k][i])].Add(sheet.samples[k][i], incident(k, i));
    }
  }
  return systems;
}

// Deviations of the blocks, tile by tile.
class Tiles {
 public:
  Tiles(const std::vector<BlockNormal>& systems, double tile_mm) {
    for (const BlockNormal& system : systems) {
      if (system.lights >= kFewestLightsSeen) {
        low_ = low_.cwiseMin(system.point_mm.head<2>());
        high_ = high_.cwiseMax(system.point_mm.head<2>());
      }
    }
    counts_ = ((high_ - low_) / tile_mm).array().round().max(1.0);
    tiles_.resize(static_cast<size_t>(counts_.prod()));
    for (const BlockNormal& system : systems) {
      if (const std::optional<Eigen::Vector3d> deviation = system.Deviation()) {
        tiles_[IndexOf(system.point_mm)].push_back(*deviation);
      }
    }
  }

  // Returns the medians of (2) of the tiles that are filled well enough.
  [[nodiscard]] std::vector<Eigen::Vector3d> Medians() const {
    size_t fullest = 0;
    for (const std::vector<Eigen::Vector3d>& tile : tiles_) {
      fullest = std::max(fullest, tile.size());
    }
    std::vector<Eigen::Vector3d> medians;
    for (const std::vector<Eigen::Vector3d>& tile : tiles_) {
      if (!tile.empty() &&
          static_cast<double>(tile.size()) >= kLeastFilled * static_cast<double>(fullest)) {
        medians.push_back(MedianOf(tile));
      }
    }
    return medians;
  }

 private:
  [[nodiscard]] size_t IndexOf(const Eigen::Vector3d& point_mm) const {
    const Eigen::Array2d extent = (high_ - low_).array().max(1e-9);
    const Eigen::Array2d at = ((point_mm.head<2>() - low_).array() / extent * counts_)
                                  .floor()
                                  .max(0.0)
                                  .min(counts_ - 1.0);
    return static_cast<size_t>(at.y() * counts_.x() + at.x());
  }

  static Eigen::Vector3d MedianOf(const std::vector<Eigen::Vector3d>& values) {
    Eigen::Vector3d median;
    for (Eigen::Index c = 0; c < 3; ++c) {
      std::vector<double> component(values.size());
      std::ranges::transform(values, component.begin(),
                             [c](const Eigen::Vector3d& value) { return value[c]; });
      median[c] = Median(std::move(component));
    }
    return median;
  }

  Eigen::Vector2d low_ = Eigen::Vector2d::Constant(1e300);
  Eigen::Vector2d high_ = Eigen::Vector2d::Constant(-1e300);
  Eigen::Array2d counts_ = Eigen::Array2d::Ones();
  std::vector<std::vector<Eigen::Vector3d>> tiles_;
};

}  // namespace

Status FlatnessOptions::Validate() const {
  if (!(tile_mm > 0.0 && std::isfinite(tile_mm))) {
    return Fail(ErrorCode::kInvalidArgument, "tile_mm = {:g}; need a number > 0", tile_mm);
  }
  return {};
}

Result<Flatness> FlatnessOf(const SheetReadings& sheet, const IncidentOf& incident,
                            const FlatnessOptions& options) {
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  const std::vector<BlockNormal> systems = SystemsOf(sheet, incident);
  const auto seen = std::ranges::find_if(
      systems, [](const BlockNormal& system) { return system.Deviation().has_value(); });
  if (seen == systems.end()) {
    return Fail(ErrorCode::kDegenerate,
                "no part of the sheet is seen under {} lights; a normal needs that many",
                kFewestLightsSeen);
  }
  const Eigen::Vector3d normal = seen->normal;
  Flatness flatness;
  for (const Eigen::Vector3d& median : Tiles(systems, options.tile_mm).Medians()) {
    const Eigen::Vector3d n = normal + median;
    const double angle_rad = AngleBetweenRad(n, normal);
    flatness.worst_rad = std::max(flatness.worst_rad, angle_rad);
    flatness.rms_rad += angle_rad * angle_rad;
    ++flatness.tiles;
  }
  flatness.rms_rad = std::sqrt(flatness.rms_rad / flatness.tiles);
  return flatness;
}

Result<Flatness> FlatnessOf(const SheetReadings& sheet, const Lights& lights,
                            const FlatnessOptions& options) {
  return FlatnessOf(
      sheet,
      [&](size_t k, size_t i) { return IncidentAt(lights[k], sheet.samples[k][i].point_mm); },
      options);
}

}  // namespace sateen
