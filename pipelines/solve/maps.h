#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/files/output_folder.h"
#include "imaging/band_writer.h"
#include "imaging/light_stack.h"
#include "imaging/show/thumbnail.h"
#include "pipelines/solve/maps_facts.h"
#include "solver/lambertian.h"

namespace sateen {

inline constexpr int kOverviewPanelWidthPx = 640;

/// Stages the maps of a solve, band by band from the top:
///
///     normal.exr, normal.png, albedo.exr, residual.exr, samples.png, reason.png
///     uncertainty.exr, albedo_uncertainty.exr, model.png   of a ladder
///     error.exr        angular error in degrees, where there is truth
///     overview.png     a frame, the normals, the albedo, and the error or else the residual
///
/// The files are the same for the same maps, however they are cut into bands.
class MapsWriter {
 public:
  [[nodiscard]] static Result<MapsWriter> Begin(ImageSize size_px, const MapsFacts& facts,
                                                bool has_error, OutputFolder& folder);

  // Writes the next rows, and their `angular_error_deg` where the maps have one.
  [[nodiscard]] Status Add(const NormalField& band,
                           const Image<float>* angular_error_deg = nullptr);
  // Closes the files and writes the overview. `first_frame` is as small as
  // Thumbnail(size_px, kOverviewPanelWidthPx, 3) makes it.
  [[nodiscard]] Status Finish(const Image3& first_frame, OutputFolder& folder);

 private:
  MapsWriter(ImageSize size_px, NormalY normal_y);

  NormalY normal_y_;
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

// Stages maps that are held whole. error.exr is among them where there is an error.
[[nodiscard]] Status StageMaps(const NormalField& field, const LightFrame& first_frame,
                               const std::optional<Image<float>>& angular_error_deg,
                               const MapsFacts& facts, OutputFolder& folder);

}  // namespace sateen
