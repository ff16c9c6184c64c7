#pragma once

#include <optional>
#include <string>

#include "core/error.h"
#include "core/output_folder.h"
#include "imaging/light_stack.h"
#include "solver/lambertian.h"

namespace sateen::cli {

struct MapsOptions {
  bool normal_y_down = false;  // the DirectX convention instead of OpenGL's
};

/// Stages the maps of a solve: normal.exr and .png, albedo.exr, residual.exr, samples.png,
/// reason.png, of a ladder uncertainty.exr and model.png, and overview.png (a frame, the normals, the albedo, and the error or, without truth,
/// the residual, each with its caption and the heat with its scale). `angular_error_deg` also goes to error.exr.
[[nodiscard]] Status StageMaps(const NormalField& field, const LightFrame& first_frame,
                               const std::optional<Image<float>>& angular_error_deg,
                               const MapsOptions& options, OutputFolder& folder);

}  // namespace sateen::cli
