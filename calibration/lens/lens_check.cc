#include "calibration/lens/lens_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/angle.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr size_t kEnoughViews = 8;
constexpr double kEnoughSpread = 30.0 * kRadPerDeg;
constexpr double kEnoughCovered = 0.7;  // share of the cells
constexpr double kFocalSd = 2e-3;       // relative
constexpr double kCornerSdPx = 1.0;
constexpr double kHeldOutRatio = 1.5;
constexpr double kBlurRatio = 2.0;  // times the median
constexpr double kSharpPx = 1.2;    // edge width that is never called blurred

void WarnOfBlur(const LensFit& fit, std::vector<std::string>& warnings) {
  std::vector<double> widths_px;
  for (const LensViewReport& view : fit.views) {
    if (view.left_out.empty()) {
      widths_px.push_back(view.edge_px);
    }
  }
  const double median_px = Median(std::move(widths_px));
  const double limit_px = std::max(kBlurRatio * median_px, kSharpPx);
  for (const LensViewReport& view : fit.views) {
    if (view.left_out.empty() && view.edge_px > limit_px) {
      warnings.push_back(
          fmt::format("{} is blurred: its edges are {:.1f} px wide, those of the median view "
                      "{:.1f} px; did the "
                      "board or the camera move, or was the board out of focus?",
                      view.name, view.edge_px, median_px));
    }
  }
}

// Warns where the displacement in the corners is not known. A term may be small against its
// standard deviation because the lens has little of it; only its effect in the picture counts.
void WarnOfDistortion(const LensFit& fit, std::vector<std::string>& warnings) {
  if (!(fit.corner_sd_px > kCornerSdPx)) {
    return;
  }
  constexpr std::array kNames = {"k1", "k2", "p1", "p2", "k3"};
  std::vector<std::string> unknown;
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (fit.distortion_sd[i] > std::abs(fit.camera.distortion[i])) {
      unknown.push_back(fmt::format("{} {:.3g} +- {:.3g}", kNames[i], fit.camera.distortion[i],
                                    fit.distortion_sd[i]));
    }
  }
  const std::string how_well = std::isfinite(fit.corner_sd_px)
                                   ? fmt::format("known to {:.1f} px", fit.corner_sd_px)
                                   : "not known: by some of the views the lens folds there";
  warnings.push_back(
      fmt::format("distortion in the corners of the image is {}{}{}; take more views with the "
                  "board reaching into all four corners",
                  how_well, unknown.empty() ? "" : "; not determined: ", fmt::join(unknown, ", ")));
}

}  // namespace

double SpreadOfTiltsRad(const LensFit& fit) {
  double spread = 0.0;
  for (const LensViewReport& a : fit.views) {
    for (const LensViewReport& b : fit.views) {
      spread = std::max(spread, AngleBetweenRad(a.normal_in_camera, b.normal_in_camera));
    }
  }
  return spread;
}

std::vector<std::string> WarningsOf(const LensFit& fit) {
  std::vector<std::string> warnings;
  const auto used = static_cast<size_t>(std::count_if(
      fit.views.begin(), fit.views.end(), [](const auto& view) { return view.left_out.empty(); }));
  if (used < kEnoughViews) {
    warnings.push_back(fmt::format("{} views; take {} or more", used, kEnoughViews));
  }
  const double spread_deg = SpreadOfTiltsRad(fit) * kDegPerRad;
  if (spread_deg < kEnoughSpread * kDegPerRad) {
    warnings.push_back(fmt::format(
        "the views are alike: the board's tilts differ by {:.0f} degrees; tilt it by 20 "
        "to 40 degrees to the left, right, front and back",
        spread_deg));
  }
  WarnOfBlur(fit, warnings);
  const Image<int>& cells = fit.coverage;
  std::vector<std::string_view> empty;
  empty.reserve(4);
  const auto look_at = [&](int x, int y, std::string_view name) {
    if (cells.At(x, y) == 0) {
      empty.push_back(name);
    }
  };
  look_at(0, 0, "top left");
  look_at(cells.width - 1, 0, "top right");
  look_at(0, cells.height - 1, "bottom left");
  look_at(cells.width - 1, cells.height - 1, "bottom right");
  if (!empty.empty()) {
    warnings.push_back(fmt::format(
        "no board corner in the {} of the image, where the distortion is then a guess; show the "
        "board there",
        fmt::join(empty, ", ")));
  }
  const auto covered = static_cast<double>(
      std::count_if(cells.pixels.begin(), cells.pixels.end(), [](int n) { return n > 0; }));
  const double share = covered / static_cast<double>(cells.pixels.size());
  if (share < kEnoughCovered) {
    warnings.push_back(fmt::format("board corners cover {:.0f} % of the image; cover {:.0f} %",
                                   100.0 * share, 100.0 * kEnoughCovered));
  }
  const double focal_sd = fit.pinhole_sd[0] / fit.camera.fx;
  if (focal_sd > kFocalSd) {
    warnings.push_back(fmt::format(
        "the focal length is known to {:.2f} %; take more views, tilted more", 100.0 * focal_sd));
  }
  WarnOfDistortion(fit, warnings);
  if (fit.held_out_rms_px > kHeldOutRatio * fit.rms_px) {
    warnings.push_back(
        fmt::format("views held out are off by {:.2f} px and the others by {:.2f}; take more views",
                    fit.held_out_rms_px, fit.rms_px));
  }
  return warnings;
}

}  // namespace sateen
