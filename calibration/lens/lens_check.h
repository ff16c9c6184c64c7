#pragma once

#include <string>
#include <vector>

#include "calibration/lens/lens.h"

namespace sateen {

// Returns advice on what to photograph for a better lens: LensFit::warnings, from the other fields.
[[nodiscard]] std::vector<std::string> WarningsOf(const LensFit& fit);

// Returns the largest angle between the boards of two views used.
[[nodiscard]] double SpreadOfTiltsRad(const LensFit& fit);

}  // namespace sateen
