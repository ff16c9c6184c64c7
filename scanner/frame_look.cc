#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "scanner/frame_check.h"

namespace sateen {
namespace {

constexpr BlockGrid kCheckGrid = {.columns = 24, .rows = 16};
constexpr int kSitesOfBlock = 4;     // fewest, along each side
constexpr int kMiddleCells = 512;    // along each side of the middle, at most
constexpr double kHighPassPx = 3.0;  // standard deviation of what is taken out

// The grid of the checks, or as much of it as a small picture has room for.
BlockGrid GridOf(const Rig& rig) {
  if (!rig.camera) {
    return kCheckGrid;
  }
  const ImageSize size = rig.camera->size_px;
  return {.columns = std::clamp(size.width / kSitesOfBlock, 1, kCheckGrid.columns),
          .rows = std::clamp(size.height / kSitesOfBlock, 1, kCheckGrid.rows)};
}

// Cells of 2 x 2 of the middle of a plane.
void AddMiddle(const Image<float>& plane, Image<float>& middle) {
  const int width = std::min(plane.width / 2, kMiddleCells);
  const int height = std::min(plane.height / 2, kMiddleCells);
  if (middle.pixels.empty()) {
    middle = Image<float>(width, height);
  }
  // Even, so that the colours of a mosaic keep their places.
  const int left = (plane.width / 2 - width) / 2 * 2;
  const int top = (plane.height / 2 - height) / 2 * 2;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int u = left + 2 * x;
      const int v = top + 2 * y;
      middle.At(x, y) +=
          plane.At(u, v) + plane.At(u + 1, v) + plane.At(u, v + 1) + plane.At(u + 1, v + 1);
    }
  }
}

Result<Image<float>> ReadMiddle(const std::filesystem::path& path) {
  Image<float> middle;
  if (IsRawName(path)) {
    return ReadRawMosaic(path).map([&](const RawMosaic& mosaic) {
      AddMiddle(mosaic.samples, middle);
      return std::move(middle);
    });
  }
  return ReadPhoto(path).map([&](const Photo& photo) {
    for (const Image<float>& plane : photo.rgb.planes) {
      AddMiddle(plane, middle);
    }
    return std::move(middle);
  });
}

// Texture alone, fading out towards the border, which wraps around.
cv::Mat HighPassed(const Image<float>& image) {
  cv::Mat values(image.height, image.width, CV_32F);
  std::ranges::copy(image.pixels, values.begin<float>());
  cv::Mat smooth;
  cv::GaussianBlur(values, smooth, cv::Size(), kHighPassPx);
  cv::Mat high;
  cv::Mat(values - smooth).convertTo(high, CV_64F);
  cv::Mat window;
  cv::createHanningWindow(window, high.size(), CV_64F);
  return high.mul(window);
}

// Where the parabola through three values, 1 apart, is highest, from the middle one.
double TopOfParabola(double before, double middle, double after) {
  const double curvature = before - 2.0 * middle + after;
  return curvature < 0.0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

}  // namespace

Shift ShiftBetween(const Image<float>& first, const Image<float>& second) {
  constexpr int kFewestCells = 16;
  if (first.Size() != second.Size() || std::min(first.width, first.height) < kFewestCells) {
    return {};
  }
  const cv::Mat f = HighPassed(first);
  const cv::Mat g = HighPassed(second);
  const double scale = cv::norm(f) * cv::norm(g);
  if (scale == 0.0) {
    return {};
  }
  cv::Mat spectrum_f;
  cv::Mat spectrum_g;
  cv::dft(f, spectrum_f);
  cv::dft(g, spectrum_g);
  cv::Mat product;
  cv::mulSpectrums(spectrum_g, spectrum_f, product, 0, /*conjB=*/true);
  cv::Mat correlation;  // of shift (x, y), both modulo the size
  cv::idft(product, correlation, cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
  double peak = 0.0;
  cv::Point at;
  cv::minMaxLoc(correlation, nullptr, &peak, nullptr, &at);
  const auto value = [&](int dx, int dy) {
    return correlation.at<double>((at.y + dy + first.height) % first.height,
                                  (at.x + dx + first.width) % first.width);
  };
  const Eigen::Vector2d cells((at.x > first.width / 2 ? at.x - first.width : at.x) +
                                  TopOfParabola(value(-1, 0), peak, value(1, 0)),
                              (at.y > first.height / 2 ? at.y - first.height : at.y) +
                                  TopOfParabola(value(0, -1), peak, value(0, 1)));
  return {.px = 2.0 * cells, .peak = peak / scale};  // a cell is two pixels
}

Result<FrameLook> CheckFrame(const FrameFile& file, const Rig& rig,
                             const ExposureSettings& settings, FrameRole role,
                             const FrameCheckOptions& options) {
  Result<BlockMeans> means = ReadBlockMeans(file, GridOf(rig));
  if (!means) {
    return tl::unexpected(means.error());
  }
  const std::string name = file.path.string();
  if (rig.camera && means->size_px != rig.camera->size_px) {
    return Fail(ErrorCode::kBadData,
                "{}: is {} x {} px, but the rig's camera has {} x {} px; is it the camera that was "
                "calibrated, at full size?",
                name, means->size_px.width, means->size_px.height, rig.camera->size_px.width,
                rig.camera->size_px.height);
  }
  if (means->exposure_s &&
      std::abs(*means->exposure_s / settings.exposure_s - 1.0) > options.max_exposure_error) {
    return Fail(ErrorCode::kBadData,
                "{}: was exposed for {:.4g} s, but the camera was set to {:.4g} s; is it in manual "
                "mode?",
                name, *means->exposure_s, settings.exposure_s);
  }
  const auto saturated = static_cast<double>(
      std::ranges::count_if(means->blocks, [](const BlockMean& block) { return block.saturated; }));
  const double share = saturated / static_cast<double>(means->blocks.size());
  if (share > options.max_saturated) {
    return Fail(ErrorCode::kBadData,
                "{}: {:.0f} % of the picture is saturated; at most {:.0f} % may be: expose shorter "
                "than {:.4g} s, or dim the lights with --level",
                name, 100.0 * share, 100.0 * options.max_saturated, settings.exposure_s);
  }
  FrameLook look{.means = *std::move(means)};
  if (role != FrameRole::kDark) {
    Result<Image<float>> middle = ReadMiddle(file.path);
    if (!middle) {
      return tl::unexpected(middle.error());
    }
    look.middle = *std::move(middle);
  }
  return look;
}

}  // namespace sateen
