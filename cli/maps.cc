#include "cli/maps.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "cli/canvas.h"
#include "cli/pictures.h"
#include "imaging/image_io.h"

namespace sateen::cli {
namespace {

constexpr int kPanelWidthPx = 640;
constexpr double kHeatPercentile = 0.99;

Image3 WithYDown(const Image3& normal) {
  Image3 flipped = normal;
  for (float& y : flipped[1].pixels) {
    y = -y;
  }
  return flipped;
}

// The 99th percentile over the solved pixels, which becomes white.
float TopOf(const Image<float>& values, const Image<uint8_t>& solved) {
  std::vector<float> known;
  for (size_t p = 0; p < values.pixels.size(); ++p) {
    if (solved.pixels[p] != 0) {
      known.push_back(values.pixels[p]);
    }
  }
  if (known.empty()) {
    return 1.0F;
  }
  const auto place = known.begin() + static_cast<std::ptrdiff_t>(
                                         kHeatPercentile * static_cast<double>(known.size() - 1));
  std::nth_element(known.begin(), place, known.end());
  return *place;
}

Rgb8 Overview(const NormalField& field, const Image3& normal, const LightFrame& first_frame,
              const std::optional<Image<float>>& angular_error_deg) {
  Image<uint8_t> solved(field.reason.Size());
  std::transform(field.reason.pixels.begin(), field.reason.pixels.end(), solved.pixels.begin(),
                 [](uint8_t reason) { return reason == static_cast<uint8_t>(Reason::kSolved); });
  const Image<float>& quality = angular_error_deg ? *angular_error_deg : field.residual;
  const float top = TopOf(quality, solved);
  const std::string heat = angular_error_deg ? HeatCaption("error from truth", top, "deg")
                                             : HeatCaption("residual", top, "");
  std::vector<Rgb8> panels;
  for (const auto& [panel, caption] :
       {std::pair{ShowLinear(first_frame.rgb), std::string("first frame")},
        std::pair{ShowNormal(normal), std::string("normal")},
        std::pair{ShowLinear(field.albedo), std::string("albedo")},
        std::pair{ShowHeat(quality, top, solved), heat}}) {
    panels.push_back(Captioned(Shrunk(panel, kPanelWidthPx), caption));
  }
  return ContactSheet(panels, static_cast<int>(panels.size()));
}

}  // namespace

Status StageMaps(const NormalField& field, const LightFrame& first_frame,
                 const std::optional<Image<float>>& angular_error_deg, const MapsOptions& options,
                 OutputFolder& folder) {
  const Image3 normal = options.normal_y_down ? WithYDown(field.normal) : field.normal;
  Status status = WriteExr(folder.Stage("normal.exr"), normal);
  const auto then = [&](const auto& write) {
    if (status) {
      status = write();
    }
  };
  then([&] { return WritePng16(folder.Stage("normal.png"), EncodeNormal16(normal)); });
  then([&] { return WriteExr(folder.Stage("albedo.exr"), field.albedo); });
  then([&] { return WriteExr(folder.Stage("residual.exr"), field.residual); });
  then([&] { return WritePng8(folder.Stage("samples.png"), field.samples); });
  then([&] { return WritePng8(folder.Stage("reason.png"), field.reason); });
  if (!field.model.pixels.empty()) {
    then([&] { return WriteExr(folder.Stage("uncertainty.exr"), field.uncertainty); });
    then([&] { return WritePng8(folder.Stage("model.png"), field.model); });
  } else {
    folder.Retire("uncertainty.exr");
    folder.Retire("model.png");
  }
  if (angular_error_deg) {
    then([&] { return WriteExr(folder.Stage("error.exr"), *angular_error_deg); });
  } else {
    folder.Retire("error.exr");
  }
  then([&] {
    return WritePng8(folder.Stage("overview.png"),
                     Overview(field, normal, first_frame, angular_error_deg));
  });
  return status;
}

}  // namespace sateen::cli
