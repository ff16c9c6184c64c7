#pragma once

#include <optional>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"
#include "rig/rig.h"
#include "rig/table_grid.h"
#include "solver/least_squares/gain_rows.h"

namespace sateen {

// Positions of consecutive pixels and the gains of the lights' fields there, where the lights need
// them.
struct PixelGeometry {
  std::vector<float> x_mm;  // empty where all lights are distant
  std::vector<float> y_mm;
  std::vector<float> z_mm;  // empty where the surface is the table plane
  std::vector<float> gains;
  // Begin of each light's `gains`, null for a light without a field; empty where no light has one.
  std::vector<const float*> places;
};

/// Finds the geometry of an image's rows. Without heights a pixel lies where its ray meets the
/// table plane, at x_0 of TableGrid. With them it lies where the same ray meets z, which needs no
/// other grid:
///
///     x = x_0 + (c - x_0) z / c_z,   c = the camera's centre                                  (1)
///
/// Gains are then those of the light's ray through x, from the field itself.
///
/// Cost     as TableGrid and GainRows; with heights 1 ns per pixel more, and 40 ns per pixel and
///          field
class PixelLocator {
 public:
  // Borrows `height_mm`, of the camera's size, for the time of one solve; null: 0. Fails with
  // kBadData where a near light needs positions and a pixel does not see the table.
  [[nodiscard]] static Result<PixelLocator> Make(const Rig& rig, const Image<float>* height_mm);

  // Computes rows [begin, end) into memory that is used again.
  void Locate(int begin, int end, PixelGeometry& geometry) const;
  // Returns false where all lights are distant.
  [[nodiscard]] bool HasPositions() const { return grid_.has_value(); }

 private:
  PixelLocator() = default;
  void Raise(int begin, PixelGeometry& geometry) const;
  void FillGains(int begin, int end, PixelGeometry& geometry) const;

  std::optional<TableGrid> grid_;
  std::optional<GainRows> gains_;  // absent where no light has a field
  Lights lights_;
  const Image<float>* height_mm_ = nullptr;
  Eigen::Vector3f camera_mm_ = Eigen::Vector3f::Zero();
};

// Fails with kBadData unless `height_mm` is null, or of size `size`, finite, and below the camera
// and all near lights.
[[nodiscard]] Status CheckHeight(const Image<float>* height_mm, const Rig& rig, ImageSize size);

}  // namespace sateen
