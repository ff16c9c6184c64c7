#include "pipelines/calibrate/pictures/response_pictures.h"

#include <algorithm>
#include <cmath>

#include "core/files/output_folder.h"
#include "imaging/image_io.h"
#include "imaging/show/pictures.h"
#include "imaging/show/svg_plot.h"

namespace sateen {
namespace {

using Points = std::vector<std::pair<double, double>>;

constexpr std::array<std::string_view, 3> kColours = {"#c0392b", "#1e8449", "#2264c7"};
constexpr std::array<std::string_view, 3> kColourNames = {"red", "green", "blue"};
constexpr double kLeftPx = 80.0;
constexpr double kRightPx = 700.0;
constexpr int kPlotWidthPx = 740;
constexpr std::string_view kDashed = "stroke=\"#555555\" stroke-dasharray=\"5 4\"";
constexpr int kPatchesPx = 900;  // width of the picture of the patches

std::string Legend(double y) {
  std::string svg;
  for (size_t c = 0; c < 3; ++c) {
    svg += SvgText(kRightPx - 130.0 + 55.0 * static_cast<double>(c), y, "start", kColourNames[c],
                   kColours[c]);
  }
  return svg;
}

double PowerOfTenFrom(double value) { return std::pow(10.0, std::ceil(std::log10(value))); }

std::string LinearityPlot(const ResponseFit& fit, double tolerance) {
  const double top = PowerOfTenFrom(std::max(fit.white_dn - fit.black_dn, 100.0));
  const PlotAxis x{0.0, 1.1 * (fit.white_dn - fit.black_dn), kLeftPx, kRightPx};
  const PlotAxis expected{1.0, top, kLeftPx, kRightPx, true};
  const PlotAxis measured{1.0, top, 380.0, 50.0, true};
  std::string svg = SvgGrid(expected, measured, "expected by exposure time [DN above black]",
                            "measured [DN above black]") +
                    Legend(40.0) +
                    SvgCurve(expected, measured, {{1.0, 1.0}, {top, top}}, "stroke=\"#999999\"");
  const PlotAxis percent{-4.0, 4.0, 760.0, 480.0};
  std::string below;
  below += fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#e8f2e4\"/>\n",
      kLeftPx, percent.At(100.0 * tolerance), kRightPx - kLeftPx,
      percent.At(-100.0 * tolerance) - percent.At(100.0 * tolerance));
  below +=
      SvgGrid(x, percent, "measured [DN above black]",
              fmt::format("off proportionality [%], within {:g} % is green", 100.0 * tolerance));
  for (size_t c = 0; c < 3; ++c) {
    Points points;
    Points clipped;
    for (const LinearityPoint& point : fit.linearity.points) {
      if (point.colour == c) {
        (point.is_clipped ? clipped : points).emplace_back(point.expected_dn, point.measured_dn);
      }
    }
    svg += SvgDots(expected, measured, points, kColours[c], 3.5);
    svg += SvgDots(expected, measured, clipped, "#aaaaaa", 3.5);
    Points bins;
    for (const LinearityBin& bin : fit.linearity.rgb[c].bins) {
      if (bin.sd < 0.5 * tolerance) {
        bins.emplace_back(bin.level_dn, 100.0 * bin.deviation);
      }
    }
    below += SvgDots(x, percent, bins, kColours[c], 5.0);
  }
  const double white = fit.white_dn - fit.black_dn;
  svg +=
      SvgLine(expected.begin_px, measured.At(white), expected.end_px, measured.At(white), kDashed);
  svg += SvgText(
      kLeftPx + 8.0, measured.At(white) - 6.0, "start",
      fmt::format("from {:.0f} DN on readings do not count; grey: saturated", fit.white_dn));
  below += SvgLine(x.At(white), percent.begin_px, x.At(white), percent.end_px, kDashed);
  return SvgFile(kPlotWidthPx, 820, svg + below);
}

std::string TransferPlot(const PhotonTransfer& transfer) {
  double top_mean = 10.0;
  double top_variance = 1.0;
  for (const TransferPoint& point : transfer.points) {
    top_mean = std::max(top_mean, point.mean_dn);
    top_variance = std::max(top_variance, point.variance_dn2);
  }
  const double read = transfer.read_noise_dn * transfer.read_noise_dn + 1.0 / 12.0;
  const PlotAxis x{1.0, PowerOfTenFrom(top_mean), kLeftPx, kRightPx, true};
  const PlotAxis y{std::pow(10.0, std::floor(std::log10(0.7 * read))), PowerOfTenFrom(top_variance),
                   450.0, 50.0, true};
  std::string svg = SvgGrid(x, y, "mean [DN above black]; dark pairs at the left edge",
                            "variance of one frame [DN\u00b2]") +
                    Legend(40.0);
  for (size_t c = 0; c < 3; ++c) {
    Points points;
    for (const TransferPoint& point : transfer.points) {
      if (point.colour == c && (point.is_dark || point.mean_dn > 1.0)) {
        points.emplace_back(point.is_dark ? 1.0 : point.mean_dn, point.variance_dn2);
      }
    }
    svg += SvgDots(x, y, points, kColours[c], 4.0);
  }
  Points line;
  constexpr double kStep = 1.1;
  double mean = 1.0;
  while (mean <= x.last) {
    line.emplace_back(mean, read + transfer.gain_dn_per_electron * mean);
    mean *= kStep;
  }
  svg += SvgCurve(x, y, line, "stroke=\"#222222\"");
  svg += SvgLine(x.begin_px, y.At(read), x.end_px, y.At(read), kDashed);
  svg += SvgText(kRightPx - 8.0, y.At(read) - 8.0, "end",
                 fmt::format("read noise {:.3f} DN, {:.2f} electrons", transfer.read_noise_dn,
                             transfer.read_noise_dn / transfer.gain_dn_per_electron));
  svg += SvgText(kLeftPx + 20.0, y.end_px + 24.0, "start",
                 fmt::format("gain {:.4f} DN per electron", transfer.gain_dn_per_electron));
  return SvgFile(kPlotWidthPx, 510, svg);
}

void DrawLine(Rgb8& picture, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
              const std::array<uint8_t, 3>& colour) {
  const int steps = static_cast<int>(std::ceil(2.0 * (to - from).cwiseAbs().maxCoeff())) + 1;
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector2d at = from + (to - from) * i / steps;
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        const int x = static_cast<int>(std::lround(at.x())) + dx;
        const int y = static_cast<int>(std::lround(at.y())) + dy;
        if (x >= 0 && x < picture[0].width && y >= 0 && y < picture[0].height) {
          for (size_t c = 0; c < 3; ++c) {
            picture[c].At(x, y) = colour[c];
          }
        }
      }
    }
  }
}

Rgb8 PatchesPicture(const ResponseCalibration& result) {
  const Image<float>& cells = result.capture.cells;
  Image3 grey;
  grey.planes = {cells, cells, cells};
  Rgb8 picture = ShowLinear(grey);
  double scale = 1.0;
  if (picture[0].width > kPatchesPx) {
    const int before = picture[0].width;
    picture = Shrunk(picture, kPatchesPx);
    scale = static_cast<double>(picture[0].width) / before;
  } else {
    const int factor = std::max(1, kPatchesPx / picture[0].width);
    picture = Enlarged(picture, factor);
    scale = factor;
  }
  for (size_t patch = 0; patch < result.capture.corners.size(); ++patch) {
    const bool is_left_out = std::ranges::any_of(
        result.fit.uneven, [&](const UnevenPatch& uneven) { return uneven.patch == patch; });
    const std::vector<Eigen::Vector2d>& corners = result.capture.corners[patch];
    for (size_t i = 0; i < corners.size(); ++i) {
      const auto placed = [&](const Eigen::Vector2d& corner) {
        return Eigen::Vector2d(scale * (corner.array() + 0.5) - 0.5);
      };
      DrawLine(
          picture, placed(corners[i]), placed(corners[(i + 1) % corners.size()]),
          is_left_out ? std::array<uint8_t, 3>{230, 40, 30} : std::array<uint8_t, 3>{40, 200, 60});
    }
  }
  return picture;
}

}  // namespace

Status DrawResponse(const ResponseCalibration& result) {
  Result<OutputFolder> folder = OutputFolder::Open(result.pictures);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  Status status =
      folder->WriteText("linearity.svg", LinearityPlot(result.fit, result.tolerance)).and_then([&] {
        return WritePng8(folder->Stage("patches.png"), PatchesPicture(result));
      });
  if (status && result.fit.transfer) {
    status = folder->WriteText("photon-transfer.svg", TransferPlot(*result.fit.transfer));
  } else if (status) {
    folder->Retire("photon-transfer.svg");
  }
  return status.and_then([&] { return folder->Commit(); });
}

}  // namespace sateen
