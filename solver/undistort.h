#pragma once

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "rig/camera.h"
#include "solver/lambertian.h"

namespace sateen {

/// The maps of a solve as PinholeOf(camera) would have them: of the same size and camera matrix,
/// without distortion.
///
///     M'(u, v) = M(x),  x = PixelOfPinholePixel(camera, u, v)                                 (1)
///
/// M between pixels by Catmull and Rom's cubic where all 16 around are solved, linearly where only
/// the nearest four are; normals are then normalised. A pixel is unsolved where one of those four
/// is, for its reason, and outside the mask where x is outside the image. Samples are the nearest
/// pixel's, the residual is linear.
///
/// Errors   kBadData: another size than the camera's; kCancelled
/// Cost     some 0.2 us a pixel and thread
[[nodiscard]] Result<NormalField> Undistorted(const NormalField& field, const Camera& camera,
                                              const Task& task = {});

// The same of one plane, linearly; 0 where x is outside the image.
[[nodiscard]] Result<Image<float>> Undistorted(const Image<float>& plane, const Camera& camera,
                                               const Task& task = {});

}  // namespace sateen
