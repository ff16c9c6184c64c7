#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <vector>

#include "core/error.h"
#include "rig/rig.h"
#include "scanner/capture/frame_taker.h"
#include "scanner/checks/signal_levels.h"
#include "scanner/sessions/session.h"

namespace sateen {

struct MeteringOptions {
  SessionKind kind = SessionKind::kFabric;  // a sheet has one exposure, and a lower peak
  int brackets = 3;                         // largest number of exposures per light; 1 to 3
  int tries = 3;                            // tries of board and camera per test frame
};

// Observer that is told of each test frame before it is taken, and of what it shows.
struct MeteringObserver {
  std::function<void(double exposure_s)> on_test;
  std::function<void(const SignalLevels& levels)> on_levels;
};

// Returns the light that is brightest on the table by the rig, by its index.
[[nodiscard]] std::size_t BrightestLight(const Rig& rig);

/// Finds the exposures of a scene by test frames of one light, at most 8 of them (ExposureSearch).
///
/// folder   receives the test frames; it is removed and made again before each, so that it must hold
///          nothing else
/// Returns  exposure times, ascending. [s]
/// Errors   those of ExposureSearch and, after all tries, of the devices; kDevice: 8 test frames
///          were not enough
[[nodiscard]] Result<std::vector<double>> FindExposures(const Rig& rig, std::size_t light,
                                                        const MeteringOptions& options,
                                                        const std::filesystem::path& folder,
                                                        FrameTaker& taker,
                                                        const MeteringObserver& observer);

}  // namespace sateen
