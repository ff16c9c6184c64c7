#include "pipelines/calibrate/pictures/lights_pictures.h"

#include <algorithm>
#include <cmath>

#include "core/files/output_folder.h"
#include "imaging/image_io.h"
#include "imaging/show/canvas.h"
#include "imaging/show/pictures.h"

namespace sateen {
namespace {

constexpr int kResidualPanelPx = 240;
constexpr int kResidualColumns = 5;
constexpr float kPercent = 100.0F;
constexpr float kBeforeTop = 10.0F;  // [%] that is shown white
constexpr float kAfterTop = 1.0F;

// |measured / expected - 1| in percent on a sheet, block by block.
Rgb8 ResidualPanel(const Sheet& sheet, size_t light, const Light& expected, double albedo,
                   float top) {
  Image<float> misfit(sheet.grid.columns, sheet.grid.rows);
  Image<uint8_t> known(sheet.grid.columns, sheet.grid.rows);
  for (size_t i = 0; i < sheet.blocks[light].size(); ++i) {
    const SheetSample& sample = sheet.samples[light][i];
    const Incident in = IncidentAt(expected, sample.point_mm);
    const double green = albedo * in.e_rgb[1] * std::max(0.0, sample.normal.dot(in.l));
    const auto block = static_cast<size_t>(sheet.blocks[light][i]);
    misfit.pixels[block] =
        kPercent * static_cast<float>(std::abs(sample.radiance_rgb[1] / green - 1.0));
    known.pixels[block] = 1;
  }
  return Captioned(Enlarged(ShowHeat(misfit, top, known), kResidualPanelPx / sheet.grid.columns),
                   fmt::format("{}: white {:g} %", expected.name, top));
}

// Returns the rough light with the flux that fits it best, as a ruler and a light meter give it.
Light RoughWithFlux(const Sheet& sheet, size_t light, double albedo) {
  Light rough = sheet.rig.lights[light];
  double measured = 0.0;
  double expected = 0.0;
  for (const SheetSample& sample : sheet.samples[light]) {
    const Incident in = IncidentAt(rough, sample.point_mm);
    measured += sample.radiance_rgb[1];
    expected += albedo * in.e_rgb[1] * std::max(0.0, sample.normal.dot(in.l));
  }
  rough.flux_rgb *= measured / expected;
  return rough;
}

}  // namespace

Status DrawLights(const std::vector<Sheet>& sheets, double albedo,
                  const LightsCalibration& result) {
  Result<OutputFolder> folder = OutputFolder::Open(result.pictures);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  const Sheet& sheet = sheets[0];
  std::vector<Rgb8> before;
  std::vector<Rgb8> after;
  for (size_t k = 0; k < result.lights.size(); ++k) {
    before.push_back(ResidualPanel(sheet, k, RoughWithFlux(sheet, k, albedo), albedo, kBeforeTop));
    after.push_back(ResidualPanel(sheet, k, result.rig.lights[k], albedo, kAfterTop));
  }
  return WritePng8(folder->Stage("before.png"), ContactSheet(before, kResidualColumns))
      .and_then([&] {
        return WritePng8(folder->Stage("residuals.png"), ContactSheet(after, kResidualColumns));
      })
      .and_then([&] { return folder->Commit(); });
}

}  // namespace sateen
