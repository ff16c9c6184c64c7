#include "scanner/checks/frame_look.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "scanner/sessions/frames/frame_loader.h"
#include "scanner/sessions/frames/sensor_reading.h"

namespace sateen {
namespace {

constexpr BlockGrid kCheckGrid = {.columns = 24, .rows = 16};
constexpr int kSitesOfBlock = 4;   // fewest, along each side
constexpr int kMiddleCells = 512;  // along each side of the middle, at most

// Returns the grid of the checks, coarser where a small picture has no room for it.
BlockGrid GridOf(const Rig& rig) {
  if (!rig.camera) {
    return kCheckGrid;
  }
  const ImageSize size = rig.camera->size_px;
  return {.columns = std::clamp(size.width / kSitesOfBlock, 1, kCheckGrid.columns),
          .rows = std::clamp(size.height / kSitesOfBlock, 1, kCheckGrid.rows)};
}

// Reads everything that the checks need of a frame, decoding it once.
Result<FrameLook> LookAt(const FrameFile& file, const BlockGrid& grid) {
  if (IsRawName(file.path)) {
    return ReadRawMosaic(file.path, file.limit).and_then([&](const RawMosaic& mosaic) {
      return ReadingOf(file, mosaic).and_then([&](const SensorReading& reading) {
        return BlockMeansOf(file, mosaic, reading, grid).map([&](BlockMeans means) {
          FrameLook look{.means = std::move(means), .levels = LevelsOf(mosaic, reading)};
          AddToMiddle(mosaic.samples, reading.saturation, file.exposure, look.middle);
          return look;
        });
      });
    });
  }
  return ReadPhoto(file.path, Encoding::kAuto, file.limit).and_then([&](const Photo& photo) {
    return BlockMeansOf(file, photo, grid).map([&](BlockMeans means) {
      FrameLook look{.means = std::move(means), .levels = LevelsOf(photo)};
      for (const Image<float>& plane : photo.rgb.planes) {
        AddToMiddle(plane, photo.saturation.value_or(std::numeric_limits<float>::infinity()),
                    file.exposure, look.middle);
      }
      return look;
    });
  });
}

}  // namespace

PixelPlace OriginOfMiddle(ImageSize size_px, ImageSize cells) {
  // Even, so that the colours of a mosaic keep their places.
  return {(size_px.width / 2 - cells.width) / 2 * 2, (size_px.height / 2 - cells.height) / 2 * 2};
}

void AddToMiddle(const Image<float>& plane, float saturation, double exposure,
                 Image<float>& middle) {
  constexpr std::array kWeights = {0.125F, 0.375F, 0.375F, 0.125F};
  if (middle.pixels.empty()) {
    middle = Image<float>(std::min(plane.width / 2, kMiddleCells),
                          std::min(plane.height / 2, kMiddleCells));
  }
  const auto [left, top] = OriginOfMiddle(plane.Size(), middle.Size());
  const auto per_exposure = static_cast<float>(1.0 / exposure);
  // Mirrored about the outermost site, which keeps the colours of a mosaic in their places.
  const auto inside = [](int i, int count) {
    return i < 0 ? -i : i >= count ? 2 * (count - 1) - i : i;
  };
  for (int y = 0; y < middle.height; ++y) {
    for (int x = 0; x < middle.width; ++x) {
      float sum = 0.0F;
      for (int v = 0; v < 4; ++v) {
        for (int u = 0; u < 4; ++u) {
          const float value = plane.At(inside(left + 2 * x + u - 1, plane.width),
                                       inside(top + 2 * y + v - 1, plane.height));
          sum += kWeights[static_cast<size_t>(u)] * kWeights[static_cast<size_t>(v)] *
                 (value < saturation ? value : std::numeric_limits<float>::quiet_NaN());
        }
      }
      middle.At(x, y) += per_exposure * sum;
    }
  }
}

Result<FrameLook> CheckFrame(const FrameFile& file, const Rig& rig,
                             const ExposureSettings& settings, FrameRole role,
                             const FrameCheckOptions& options) {
  const Result<std::string> hash = CheckedHash(file);
  Result<FrameLook> look =
      hash ? LookAt(file, GridOf(rig)) : Result<FrameLook>(tl::unexpected(hash.error()));
  if (!look) {
    return look;
  }
  look->means.sha256 = *hash;
  const BlockMeans& means = look->means;
  const std::string name = file.path.string();
  if (rig.camera && means.size_px != rig.camera->size_px) {
    return Fail(ErrorCode::kBadData,
                "{}: is {} x {} px, but the rig's camera has {} x {} px; is it the camera that was "
                "calibrated, at full size?",
                name, means.size_px.width, means.size_px.height, rig.camera->size_px.width,
                rig.camera->size_px.height);
  }
  if (means.exposure_s &&
      std::abs(*means.exposure_s / settings.exposure_s - 1.0) > options.max_exposure_error) {
    return Fail(ErrorCode::kBadData,
                "{}: was exposed for {:.4g} s, but the camera was set to {:.4g} s; is it in manual "
                "mode?",
                name, *means.exposure_s, settings.exposure_s);
  }
  if (look->levels.saturated > options.max_saturated) {
    return Fail(
        ErrorCode::kBadData,
        "{}: {:.2g} % of its pixels are saturated, more than {:.2g} %; expose for less than "
        "{:.4g} s, or dim the lights with --level",
        name, 100.0 * look->levels.saturated, 100.0 * options.max_saturated, settings.exposure_s);
  }
  if (role == FrameRole::kDark) {
    look->middle = {};
  }
  return look;
}

}  // namespace sateen
