#pragma once

#include <optional>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"
#include "rig/rig.h"
#include "rig/table_grid.h"
#include "solver/least_squares/gain_rows.h"

namespace sateen {

// Where consecutive pixels lie, and the gains of the lights' fields there, as far as the lights need them.
struct PixelGeometry {
  std::vector<float> x_mm;  // empty where all lights are distant
  std::vector<float> y_mm;
  std::vector<float> z_mm;  // empty where the surface is the table plane
  std::vector<float> gains;
  std::vector<const float*>
      places;  // of each light's gains, or null; empty where no light has a field
};

/// Finds the geometry of an image's rows. Without heights a pixel lies where its ray meets the table plane,
/// at x_0 of TableGrid; with them where the same ray meets z, which no other grid is needed for:
///
///     x = x_0 + (c - x_0) z / c_z,   c = the camera's centre                                  (1)
///
/// Gains are then those of the light's ray through x, from the field itself.
///
/// Cost     as TableGrid and GainRows; with heights 1 ns a pixel more, and 40 ns a pixel and field
class PixelLocator {
 public:
  // `height_mm`, of the camera's size, is borrowed; null: 0. kBadData where a near light needs positions
  // and a pixel does not see the table.
  [[nodiscard]] static Result<PixelLocator> Make(const Rig& rig, const Image<float>* height_mm);

  // Of rows [begin, end), into memory that is used again.
  void Locate(int begin, int end, PixelGeometry& geometry) const;
  // False where all lights are distant.
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

// kBadData unless `height_mm` is null, or of size `size`, finite, and below the camera and all lights
// that are not distant.
[[nodiscard]] Status CheckHeight(const Image<float>* height_mm, const Rig& rig, ImageSize size);

}  // namespace sateen
