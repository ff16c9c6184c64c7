#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rig/rig.h"
#include "scanner/sessions/session.h"

namespace sateen {

// Frames that a capture takes, in this order: role, light and exposure_s. The rest is still
// unknown.
using FramePlan = std::vector<SessionFrame>;

// Returns the plan: the dark, every light of the rig in its order at each exposure, the first light
// again at the first exposure, the dark again. The dark has the last exposure, the longest.
[[nodiscard]] FramePlan PlanOf(const Rig& rig, const std::vector<double>& exposures_s);

// Returns whether PlanOf() gives this plan for the rig at some exposures.
[[nodiscard]] bool IsPlanOf(const Rig& rig, const FramePlan& plan);

// Returns the frame's light by its index in the rig; nothing for a dark frame.
[[nodiscard]] std::optional<std::size_t> LightOf(const Rig& rig, const SessionFrame& planned);

// Returns whether the frame is a dark one or its light's first exposure, which holds the bright
// parts.
[[nodiscard]] bool IsFirstExposure(const FramePlan& plan, std::size_t frame);

// Returns "dark", "led-0" or "led-0 again".
[[nodiscard]] std::string NameOf(const SessionFrame& planned);

// Returns "frames/03-led-2.dng", where "frames/04-led-2.dng" is the same light's next exposure. The
// extension is that of the file that was delivered.
[[nodiscard]] std::string FileNameOf(std::size_t frame, const SessionFrame& planned,
                                     const std::filesystem::path& delivered);

}  // namespace sateen
