#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

/// Reads the lit frames of a sheet, grey, for FitSheetPose(): of camera RAW every site of the
/// mosaic as it is, no demosaicing, colours balanced so that the paper is grey; exposure divided
/// out. Then each square of shrink x shrink pixels joined to one.
///
/// Errors   kIo, kBadData: as ReadRawMosaic() and ReadPhoto(); kCancelled
[[nodiscard]] Result<std::vector<Image<float>>> ReadSheetFrames(const std::vector<FrameFile>& lit,
                                                                int shrink, const Task& task);

}  // namespace sateen
