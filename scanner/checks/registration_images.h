#pragma once

#include <Eigen/Core>

#include "imaging/image.h"

// Images that RegisterFrames() makes from pictures. NaN is a cell that is not known.
namespace sateen {

// Returns the image at half its size: means of 2 x 2 cells.
[[nodiscard]] Image<float> Halved(const Image<float>& image);

// Less the mean of the known ones among 9 x 9 cells around each.
[[nodiscard]] Image<float> HighPassed(const Image<float>& image);

// Returns image(x + shift) by LanczosAt(); not known beyond the picture. A cubic of four samples
// would do for the eye, but moves a texture of 4 cells by a fifth less than it says.
[[nodiscard]] Image<float> Moved(const Image<float>& image, const Eigen::Vector2d& shift);

}  // namespace sateen
