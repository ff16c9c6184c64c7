#include "solver/light_doubt.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/angle.h"

namespace sateen {
namespace {

constexpr int kTile = 64;  // pixels
constexpr auto kSquareDegrees = static_cast<float>(kDegPerRad * kDegPerRad);

struct LightErrors {
  double direction = 0.0;   // sd(delta)^2, in radians
  double irradiance = 0.0;  // sd(epsilon)^2
};

// (2)
LightErrors ErrorsOf(const Light& light, const Eigen::Vector3d& x_mm) {
  LightErrors errors{.irradiance = std::pow(light.irradiance_sd.value_or(0.0), 2.0)};
  if (light.model == LightModel::kDistant) {
    // Along two axes, of which one angle to the truth is made.
    errors.direction = std::pow(light.direction_sd_deg.value_or(0.0) * kRadPerDeg, 2.0) / 2.0;
  } else if (light.position_sd_mm) {
    const Eigen::Vector3d to_light = light.position_mm - x_mm;
    const double along = light.position_sd_mm->cwiseProduct(to_light.normalized()).squaredNorm();
    errors.direction = (light.position_sd_mm->squaredNorm() - along) / 2.0 / to_light.squaredNorm();
  }
  return errors;
}

// Q of (3) at a place on the table, in square radians.
Eigen::Matrix3d QAt(const Lights& lights, const Eigen::Vector3d& x_mm) {
  Eigen::MatrixX3d directions(static_cast<Eigen::Index>(lights.size()), 3);
  for (size_t k = 0; k < lights.size(); ++k) {
    directions.row(static_cast<Eigen::Index>(k)) = IncidentAt(lights[k], x_mm).l;
  }
  const Eigen::Matrix3Xd g = directions.completeOrthogonalDecomposition().pseudoInverse();  // (1)
  Eigen::Matrix3d q = Eigen::Matrix3d::Zero();
  for (size_t k = 0; k < lights.size(); ++k) {
    const LightErrors errors = ErrorsOf(lights[k], x_mm);
    const auto column = static_cast<Eigen::Index>(k);
    const double c_squared = directions(column, 2) * directions(column, 2);
    q += g.col(column) * g.col(column).transpose() *
         (errors.direction * (1.0 - c_squared) + errors.irradiance * c_squared);
  }
  return q;
}

// Where the middle of a tile sees the table; the origin where it does not, or all lights are distant.
Eigen::Vector3d PlaceOf(const Rig& rig, double column, double row) {
  const std::optional<Eigen::Vector3d> place =
      rig.camera ? TablePointOfPixel(*rig.camera, column, row) : std::nullopt;
  return place.value_or(Eigen::Vector3d::Zero());
}

}  // namespace

std::optional<LightDoubt> LightDoubt::Make(const Rig& rig, ImageSize size) {
  if (std::ranges::none_of(rig.lights, [](const Light& light) {
        return light.position_sd_mm || light.direction_sd_deg || light.irradiance_sd;
      })) {
    return std::nullopt;
  }
  LightDoubt doubt;
  doubt.columns_ = (size.width + kTile - 1) / kTile;
  const int rows = (size.height + kTile - 1) / kTile;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < doubt.columns_; ++column) {
      const Eigen::Matrix3d q =
          QAt(rig.lights, PlaceOf(rig, std::min((column + 0.5) * kTile, size.width - 1.0),
                                  std::min((row + 0.5) * kTile, size.height - 1.0)));
      doubt.tiles_.push_back({static_cast<float>(q(0, 0)), static_cast<float>(q(1, 1)),
                              static_cast<float>(q(2, 2)), static_cast<float>(q(0, 1)),
                              static_cast<float>(q(0, 2)), static_cast<float>(q(1, 2))});
    }
  }
  return doubt;
}

void LightDoubt::AddToRow(int row, size_t first, NormalField& field) const {
  const auto width = static_cast<size_t>(field.reason.width);
  for (size_t column = 0; column < width; ++column) {
    const size_t p = first + column;
    if (!IsSolved(field, p)) {
      continue;
    }
    const auto& [xx, yy, zz, xy, xz, yz] =
        tiles_[static_cast<size_t>(row / kTile * columns_) + column / kTile];
    const float x = field.normal[0].pixels[p];
    const float y = field.normal[1].pixels[p];
    const float z = field.normal[2].pixels[p];
    const float along =
        xx * x * x + yy * y * y + zz * z * z + 2.0F * (xy * x * y + xz * x * z + yz * y * z);
    const float across = std::max(0.0F, xx + yy + zz - along);  // (3)
    float& uncertainty = field.uncertainty.pixels[p];
    uncertainty = std::min(180.0F, std::sqrt(uncertainty * uncertainty + kSquareDegrees * across));
    float& of_albedo = field.albedo_uncertainty.pixels[p];
    of_albedo = std::min(1.0F, std::sqrt(of_albedo * of_albedo + std::max(0.0F, along)));
  }
}

}  // namespace sateen
