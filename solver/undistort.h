#pragma once

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "rig/camera.h"
#include "solver/normal_field.h"

namespace sateen {

/// Resamples the maps of a solve to PinholeOf(camera): the same size and camera matrix, without
/// distortion.
///
///     M'(u, v) = M(x),  x = PixelOfPinholePixel(camera, u, v)                                 (1)
///
/// Normals and albedo are interpolated by Catmull and Rom's cubic where all 16 pixels around x are
/// solved, linearly where only the nearest four are; normals are then normalised. Residual and
/// uncertainties are interpolated linearly, samples and model are the nearest pixel's. A pixel is
/// unsolved where one of the four is, with its reason. It is outside the mask where x is outside
/// the image.
///
/// Errors   kBadData: another size than the camera's; kCancelled
/// Cost     some 0.2 us per pixel and thread
[[nodiscard]] Result<NormalField> Undistorted(const NormalField& field, const Camera& camera,
                                              const Task& task = {});

// Resamples one plane linearly; 0 where x is outside the image.
[[nodiscard]] Result<Image<float>> Undistorted(const Image<float>& plane, const Camera& camera,
                                               const Task& task = {});

}  // namespace sateen
