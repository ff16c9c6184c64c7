#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "scanner/capture/capture_request.h"
#include "scanner/capture/preview.h"
#include "scanner/daemon/board_job.h"
#include "scanner/daemon/job.h"
#include "scanner/daemon/light_job.h"

// Work of the daemon: each function makes one job from a request.
namespace sateen {

// Result: SummaryJson. Progress: EventJson.
[[nodiscard]] JobRequest CaptureJob(CaptureRequest request, std::string owner);
// Result: ForecastJson. No light goes on.
[[nodiscard]] JobRequest ForecastJob(CaptureRequest request, std::string owner);
// Result: PreviewJson; the picture goes to `output`, or where that is empty into `jpeg`.
[[nodiscard]] JobRequest PreviewJob(PreviewRequest request, std::filesystem::path output,
                                    std::shared_ptr<std::string> jpeg, std::string owner);
// Result: {"cancelled": false}. Progress: LightOnJson, once, when the light is on.
[[nodiscard]] JobRequest LightJob(LightRequest request, std::string owner);
// Result: BoardJson.
[[nodiscard]] JobRequest BoardJob(BoardChange change, std::string owner);
// Result: {"lit": []}, as the board says it.
[[nodiscard]] JobRequest LightsOffJob(std::string owner);
// Connects to board and camera. Result: DevicesJson, with what the system shows beside them.
[[nodiscard]] JobRequest DevicesJob(std::string owner);

}  // namespace sateen
