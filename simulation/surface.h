#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// Height, slope and material at one place of a surface.
struct SurfacePoint {
  double height_mm = 0.0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();  // dz/dx, dz/dy
  int part = 0;                                     // which material: index into Surface::Parts()
  int yarn = 0;                                     // which yarn of that part

  // Returns (-dz/dx, -dz/dy, 1) of unit length.
  [[nodiscard]] Eigen::Vector3d Normal() const;
};

/// A height field z(x, y) over the table, in millimetres, with its slope in closed form.
///
/// |grad z| <= MaxSlope() everywhere. That makes a ray search safe: see simulation/trace.h.
class Surface {
 public:
  Surface() = default;
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;
  virtual ~Surface() = default;

  [[nodiscard]] virtual SurfacePoint At(double x_mm, double y_mm) const = 0;
  // Bounds of the height; infinite for a plane that is tilted.
  [[nodiscard]] virtual double LowestMm() const = 0;
  [[nodiscard]] virtual double HighestMm() const = 0;
  [[nodiscard]] virtual double MaxSlope() const = 0;
  // Returns the size of its smallest detail, which sets how finely rays are followed.
  [[nodiscard]] virtual double DetailMm() const = 0;
  [[nodiscard]] virtual bool IsPlane() const { return false; }
  // Names of the parts that may have a material of their own, "surface" first or the only one.
  [[nodiscard]] virtual std::vector<std::string_view> Parts() const { return {"surface"}; }
};

using SurfacePtr = std::unique_ptr<const Surface>;

// Shapes. Their parameters are checked by the maker, which names the first that is out of range
// (kInvalidArgument). Angles are below pi/2.

// Makes the plane `height_mm` above the table's origin that rises by `slope_rad` towards
// `azimuth_rad` (from x towards y).
[[nodiscard]] Result<SurfacePtr> MakePlane(double slope_rad, double azimuth_rad,
                                           double height_mm = 0.0);

// Makes a cap of a sphere on the table, as wide as its edge is `edge_rad` steep.
[[nodiscard]] Result<SurfacePtr> MakeSphereCap(double radius_mm, double edge_rad);

// Makes a groove along y, `depth_mm` below the table plane, between two walls that include
// `opening_rad`.
[[nodiscard]] Result<SurfacePtr> MakeGroove(double depth_mm, double opening_rad);

// Makes a stair that goes up by `rise_mm` every `tread_mm` of x, over risers `riser_mm` wide,
// `count` times, and is level before and after.
[[nodiscard]] Result<SurfacePtr> MakeSteps(int count, double tread_mm, double rise_mm,
                                           double riser_mm);

// Makes z = a (sin kx + sin ky), k = 2 pi / period, with normals tilted by at most `max_slope_rad`.
[[nodiscard]] Result<SurfacePtr> MakeWaves(double period_mm, double max_slope_rad);

// Heights in millimetres, row down, `pitch_mm` apart, centred on the table's origin; between them
// Catmull-Rom cubic, so that the slope is continuous; beyond the edge its last row and column.
[[nodiscard]] Result<SurfacePtr> MakeHeightMap(Image<float> height_mm, double pitch_mm);

}  // namespace sateen
