#include "pipelines/calibrate/pictures/check_pictures.h"

#include <algorithm>
#include <cmath>

#include "imaging/show/canvas.h"

namespace sateen {
namespace {

constexpr double kShown = 0.02;  // of the ratio, at full colour
constexpr int kRatioPanelPx = 240;
constexpr int kColumns = 5;
constexpr uint8_t kNothing = 96;

// Returns light grey for 0, towards red above and towards blue below.
std::array<uint8_t, 3> Colour(double off) {
  const double t = std::clamp(off / kShown, -1.0, 1.0);
  const auto towards = [&](double end) {
    return static_cast<uint8_t>(std::lround(std::lerp(225.0, end, std::abs(t))));
  };
  return t >= 0.0 ? std::array<uint8_t, 3>{towards(200.0), towards(0.0), towards(0.0)}
                  : std::array<uint8_t, 3>{towards(0.0), towards(40.0), towards(200.0)};
}

}  // namespace

Rgb8 RatioPicture(const CalibrationCheck& result, size_t sheet, const SheetReadings& view) {
  std::vector<Rgb8> panels;
  for (size_t k = 0; k < view.samples.size(); ++k) {
    Rgb8 panel;
    panel.fill(Image<uint8_t>(view.columns, view.rows, kNothing));
    for (size_t j = 0; j < view.blocks[k].size(); ++j) {
      const double ratio = result.check.ratios[sheet][k][j] / result.check.common_flux[1];
      const std::array<uint8_t, 3> colour = Colour(ratio - 1.0);
      for (size_t c = 0; c < 3; ++c) {
        panel[c].pixels[static_cast<size_t>(view.blocks[k][j])] = colour[c];
      }
    }
    panels.push_back(Captioned(Enlarged(panel, kRatioPanelPx / view.columns),
                               fmt::format("{}: {}, +-{:g} %", result.rig.lights[k].name,
                                           Name(result.check.lights[k].verdict), 100.0 * kShown)));
  }
  return ContactSheet(panels, kColumns);
}

}  // namespace sateen
