#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/output_folder.h"
#include "imaging/band_writer.h"
#include "imaging/light_stack.h"
#include "imaging/show/thumbnail.h"
#include "solver/lambertian.h"

namespace sateen {

inline constexpr int kOverviewPanelWidthPx = 640;

struct MapsOptions {
  bool normal_y_down = false;  // the DirectX convention instead of OpenGL's
  bool has_ladder = false;     // uncertainty.exr, albedo_uncertainty.exr and model.png, too
  bool has_error = false;      // error.exr, too
};

/// Stages the maps of a solve, band by band from the top: normal.exr and .png, albedo.exr,
/// residual.exr, samples.png, reason.png, of a ladder uncertainty.exr, albedo_uncertainty.exr and model.png,
/// the angular error as error.exr, and at the end overview.png: a frame, the normals, the albedo, and the error or,
/// without truth, the residual. The same files for the same maps, however they are cut.
class MapsWriter {
 public:
  [[nodiscard]] static Result<MapsWriter> Begin(ImageSize size_px, const MapsOptions& options,
                                                OutputFolder& folder);

  // The next rows; `angular_error_deg` of them where there is one.
  [[nodiscard]] Status Add(const NormalField& band,
                           const Image<float>* angular_error_deg = nullptr);
  // `first_frame`: shrunk as Thumbnail(size_px, kOverviewPanelWidthPx, 3) does.
  [[nodiscard]] Status Finish(const Image3& first_frame, OutputFolder& folder);

 private:
  MapsWriter(ImageSize size_px, const MapsOptions& options);

  MapsOptions options_;
  int next_row_ = 0;
  std::optional<BandWriter> normal_;
  std::optional<BandWriter> normal_png_;
  std::optional<BandWriter> albedo_;
  std::optional<BandWriter> residual_;
  std::optional<BandWriter> samples_;
  std::optional<BandWriter> reason_;
  std::optional<BandWriter> uncertainty_;
  std::optional<BandWriter> albedo_uncertainty_;
  std::optional<BandWriter> model_;
  std::optional<BandWriter> error_;
  Thumbnail small_normal_;
  Thumbnail small_albedo_;
  Thumbnail small_quality_;
};

// Maps that are there whole.
[[nodiscard]] Status StageMaps(const NormalField& field, const LightFrame& first_frame,
                               const std::optional<Image<float>>& angular_error_deg,
                               const MapsOptions& options, OutputFolder& folder);

}  // namespace sateen
