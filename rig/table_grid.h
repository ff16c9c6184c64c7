#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/error.h"
#include "rig/camera.h"

namespace sateen {

/// Table position of every pixel, fast: exact at the knots of a grid (TablePointOfPixel), cubic
/// Lagrange interpolation between them. With 16 px between knots, lenses as strong as k1 = -0.3
/// and cameras tilted by 20 degrees stay within 1e-3 px of the exact position (a test measures it).
class TableGrid {
 public:
  // kBadData where a pixel of the camera does not see the table plane.
  [[nodiscard]] static Result<TableGrid> Make(const Camera& camera);

  // x and y of the table positions of the pixels of row `v`, from column 0 on.
  void Row(int v, std::span<float> x_mm, std::span<float> y_mm) const;

  [[nodiscard]] ImageSize Size() const { return size_px_; }

 private:
  TableGrid() = default;

  ImageSize size_px_;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<Eigen::Vector2d> knots_;  // row-major, rows_ x columns_
};

}  // namespace sateen
