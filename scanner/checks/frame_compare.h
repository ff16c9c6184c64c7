#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "rig/rig.h"
#include "scanner/checks/capture_check.h"
#include "scanner/checks/light_patterns.h"

// The parts of CheckCapture() that lay frames over each other. `on`: the lights that are on, alone.
namespace sateen {

// Returns CaptureCheck::shifts. The shift of a light that is not on is infinitely uncertain.
[[nodiscard]] std::vector<Shift> ShiftsOf(const Rig& rig, const CaptureLooks& looks,
                                          const std::vector<bool>& on,
                                          const FrameCheckOptions& options);

// Returns kMoved for every frame: which frames have moved, and how far. Returns nothing if none has
// moved too far.
[[nodiscard]] std::optional<CaptureFault> MovedFault(const Rig& rig,
                                                     const std::vector<Shift>& shifts,
                                                     const FrameCheckOptions& options);

// Returns the light whose frame alone has moved too far, while those after it have not.
[[nodiscard]] std::optional<std::size_t> OnlyOneThatMoved(const std::vector<Shift>& shifts,
                                                          const FrameCheckOptions& options);

// Returns kOtherLight: the frame of `light` is lit from where the rig has `other`.
[[nodiscard]] CaptureFault OtherLightFault(const Rig& rig, std::size_t light, std::size_t other);

// Returns kShaded, for one light each. Returns kOtherLight where lights have changed places, or one
// is lit as another is, which on cloth that does not lie flat only normals show. `signal`:
// [light][block], dark subtracted. Shadows that take less than `min_light` of all the light of a
// frame are left aside.
[[nodiscard]] std::vector<CaptureFault> ShadedFaults(const Rig& rig, const CaptureLooks& looks,
                                                     const std::vector<BlockField>& signal,
                                                     const std::vector<bool>& on,
                                                     const FrameCheckOptions& options,
                                                     double min_light = 0.0);

}  // namespace sateen
