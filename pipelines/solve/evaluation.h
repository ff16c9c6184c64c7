#pragma once

#include <optional>

#include "core/error.h"
#include "imaging/image.h"
#include "rig/camera.h"
#include "scanner/sessions/truth.h"
#include "solver/evaluate.h"
#include "solver/lambertian.h"

namespace sateen {

// Errors of a solve against truth; all absent where no solved pixel has truth.
struct Evaluation {
  std::optional<ErrorStatistics> angular_error_deg;
  // Part of it below 1 cycle per 50 mm; absent without a camera.
  std::optional<ErrorStatistics> low_frequency_error_deg;
  std::optional<ErrorStatistics> albedo_error;
  // Angular error of each pixel in degrees, as error.exr holds it.
  std::optional<Image<float>> error_map_deg;
};

// Compares maps with truth. `camera` sees the maps; the figure below 1 cycle per 50 mm needs it.
//
// Errors  kBadData: maps and truth differ in size
[[nodiscard]] Result<Evaluation> Evaluate(const NormalField& field, const Truth& truth,
                                          const std::optional<Camera>& camera);

}  // namespace sateen
