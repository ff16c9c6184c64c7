#pragma once

#include <optional>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "rig/light.h"

namespace sateen {

// Returns the light whose pattern the samples of light k show, if it fits twice as well as k's own,
// whatever the brightness: frames or cables are swapped. Returns nothing otherwise.
[[nodiscard]] std::optional<size_t> LitFrom(const Lights& lights,
                                            const std::vector<SheetSample>& samples, size_t k);

}  // namespace sateen
