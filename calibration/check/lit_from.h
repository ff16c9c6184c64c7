#pragma once

#include <optional>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "rig/light.h"

namespace sateen {

// The light of which the samples of light k show the pattern, where that fits twice as well as its
// own, whatever the brightness: frames or cables are swapped. Nothing where its own does.
[[nodiscard]] std::optional<size_t> LitFrom(const Lights& lights,
                                            const std::vector<SheetSample>& samples, size_t k);

}  // namespace sateen
