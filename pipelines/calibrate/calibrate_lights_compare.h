#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "rig/rig.h"
#include "scanner/sessions/sheet_reader.h"

namespace sateen {

// Errors of the sheets' normals with lights from one way of calibrating, in the worst tile.
struct WayFigures {
  std::string key;                            // in the report
  std::string label;                          // before people
  std::optional<double> flat_deg;             // the first sheet; nothing where that way failed
  std::optional<double> tilted_deg;           // the worst of the others
  std::optional<double> direction_error_deg;  // against truth, worst light and place
};

// Returns the worst angle between two lights' directions among the samples.
[[nodiscard]] double DirectionErrorDeg(const Light& a, const Light& b,
                                       const std::vector<SheetSample>& samples);

/// Solves the sheets with lights from: the ruler, with one intensity per light; the ruler, with
/// fall-off over distance; the procedure of calibration/lights/seed_procedure.h from the first
/// sheet, in both readings; the fit, last.
///
/// fitted  the lights of the fit
/// truth   in any order, or empty
[[nodiscard]] std::vector<WayFigures> CompareWays(const std::vector<Sheet>& sheets,
                                                  const Lights& fitted, const Lights& truth,
                                                  double albedo);

}  // namespace sateen
