#pragma once

#include "core/error.h"
#include "imaging/exposure_settings.h"
#include "imaging/image.h"
#include "rig/rig.h"
#include "scanner/checks/frame_check_options.h"
#include "scanner/checks/signal_levels.h"
#include "scanner/sessions/block_means.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// Figures of one frame that the checks compare.
struct FrameLook {
  BlockMeans means;
  SignalLevels levels;
  // Middle of the picture, from which shifts are found (AddToMiddle).
  Image<float> middle;
};

struct PixelPlace {
  int x = 0;
  int y = 0;
};

// Returns the place of the middle's first cell in the picture. [px]
[[nodiscard]] PixelPlace OriginOfMiddle(ImageSize size_px, ImageSize cells);

/// Adds the middle of a plane, as radiance, to `middle`, which is created if it is empty: cells 2
/// sites apart, at most 512 x 512 of them. Each is the mean of 4 x 4 sites with weights 1, 3, 3, 1
/// along both axes. These count every colour of a mosaic alike and damp what is finer than the
/// cells, which would not move with the picture. A cell is not finite where one of its sites is
/// saturated.
void AddToMiddle(const Image<float>& plane, float saturation, double exposure,
                 Image<float>& middle);

/// Reads a frame and checks it alone:
///
/// * it decodes
/// * it has the size of the rig's camera
/// * it has the exposure time that the camera confirmed, where the file has one
/// * no more than options.max_saturated of it is clipped
///
/// `settings`  as the camera has them
/// Errors      kIo; kBadData: what is wrong, and what to do
[[nodiscard]] Result<FrameLook> CheckFrame(const FrameFile& file, const Rig& rig,
                                           const ExposureSettings& settings, FrameRole role,
                                           const FrameCheckOptions& options);

}  // namespace sateen
