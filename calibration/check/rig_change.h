#pragma once

#include <Eigen/Core>
#include <vector>

#include "rig/light.h"

namespace sateen {

// Coefficients h of equation (2) of check_model.h. [mm]
using SheetHeights = Eigen::Matrix<double, 6, 1>;

// Change of one light since it was measured.
struct LightChange {
  Eigen::Vector3d log_flux = Eigen::Vector3d::Zero();  // logarithm of its flux over the rig's
  Eigen::Vector3d moved_mm = Eigen::Vector3d::Zero();
  // Rotation of its axis about each of two directions across it.
  Eigen::Vector2d turned_rad = Eigen::Vector2d::Zero();
};

// Change of a rig, and how its sheets lie against where they were said to.
struct RigChange {
  std::vector<LightChange> lights;
  // Motion of the camera: along x, y, z [mm] and about z [rad].
  Eigen::Vector4d camera = Eigen::Vector4d::Zero();
  std::vector<SheetHeights> sheets;
};

// Unknowns that a fit may change. Fluxes are always free.
struct ChangeMask {
  std::vector<bool> moved;   // [light]
  std::vector<bool> turned;  // [light]
  bool camera = false;
  bool sheets = false;

  // Returns the number of free unknowns, fluxes not counted.
  [[nodiscard]] int Parameters(size_t sheet_count) const;
};

/// Returns the light as it is after the change. Its gain field moves with it.
[[nodiscard]] Light ChangedLight(const Light& light, const LightChange& change);

}  // namespace sateen
