#include "scanner/frame_loader.h"

#include <utility>

#include "core/parallel.h"
#include "core/sha256.h"
#include "imaging/raw.h"
#include "scanner/sensor_reading.h"

namespace sateen {
namespace {

constexpr float kSaturatedSite = 8.0F;  // times the reading at which the last channel saturates

struct LoadedFrame {
  LightFrame frame;
  bool was_srgb = false;
  std::string sha256;
};

// In their own channel, saturated samples of a balanced photo are put at its full scale.
void Balance(const SensorReading& reading, Photo& photo) {
  const float top = photo.saturation ? *photo.saturation * reading.Largest() : 0.0F;
  for (size_t c = 0; c < 3; ++c) {
    for (float& value : photo.rgb[c].pixels) {
      value = photo.saturation && value >= *photo.saturation ? top : reading.Value(value, c);
    }
  }
  if (photo.saturation) {
    photo.saturation = top;
  }
}

Result<Photo> ReadPhotoOrRaw(const FrameFile& file, Encoding encoding) {
  if (!IsRawName(file.path)) {
    return ReadPhoto(file.path, encoding).map([&](Photo photo) {
      Balance(ReadingOf(file), photo);
      return photo;
    });
  }
  return ReadRawMosaic(file.path).and_then([&](RawMosaic mosaic) {
    return ReadingOf(file, mosaic).map([&](const SensorReading& reading) {
      // A saturated site must not pass as a mean of it and its neighbours: whatever pixel it has a
      // part in, at least a quarter, comes out above the level of saturation.
      const float top = reading.FullScale();
      for (int y = 0; y < mosaic.samples.height; ++y) {
        for (int x = 0; x < mosaic.samples.width; ++x) {
          float& site = mosaic.samples.At(x, y);
          const size_t colour = mosaic.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)];
          site = site >= reading.saturation ? kSaturatedSite * top : reading.Value(site, colour);
        }
      }
      return Photo{Demosaic(mosaic), top, false};
    });
  });
}

// Equation (1) without the dark frames.
Result<LoadedFrame> LoadFrame(const FrameFile& file, Encoding encoding) {
  Result<std::string> hash = CheckedHash(file);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  Result<Photo> photo = ReadPhotoOrRaw(file, encoding);
  if (!photo) {
    return tl::unexpected(photo.error());
  }
  LoadedFrame loaded;
  loaded.frame.rgb = std::move(photo->rgb);
  loaded.frame.name = file.path.string();
  loaded.was_srgb = photo->was_srgb;
  loaded.sha256 = *std::move(hash);
  const auto per_exposure = static_cast<float>(1.0 / file.exposure);
  if (photo->saturation) {
    loaded.frame.full_scale = *photo->saturation * per_exposure;
  }
  for (Image<float>& plane : loaded.frame.rgb.planes) {
    for (float& value : plane.pixels) {
      value *= per_exposure;
    }
  }
  return loaded;
}

// Adds up one by one, in their order: memory for one dark frame, and the same bits every time.
Result<Image3> MeanDark(const std::vector<FrameFile>& dark, Encoding encoding, ImageSize size_px,
                        const Task& task, LoadedFrames& result) {
  Image3 mean(size_px);
  const float weight = 1.0F / static_cast<float>(dark.size());
  for (const FrameFile& file : dark) {
    if (const Status status = task.CheckCancelled(); !status) {
      return tl::unexpected(status.error());
    }
    const Result<LoadedFrame> loaded = LoadFrame(file, encoding);
    if (!loaded) {
      return tl::unexpected(loaded.error());
    }
    const Image3& rgb = loaded->frame.rgb;
    if (const Status status = CheckSize(loaded->frame.name, rgb.Size(), size_px); !status) {
      return tl::unexpected(status.error());
    }
    for (size_t c = 0; c < 3; ++c) {
      for (size_t p = 0; p < mean[c].pixels.size(); ++p) {
        mean[c].pixels[p] += weight * rgb[c].pixels[p];
      }
    }
    result.sha256_of_input[loaded->frame.name] = loaded->sha256;
    task.Advance();
  }
  return mean;
}

void Subtract(const Image3& dark, LightFrame& frame) {
  for (size_t c = 0; c < 3; ++c) {
    for (size_t p = 0; p < dark[c].pixels.size(); ++p) {
      float& value = frame.rgb[c].pixels[p];
      value = value >= frame.full_scale ? frame.full_scale : value - dark[c].pixels[p];
    }
  }
}

// Moves the frames into `result`; the first failure in their order is the error.
Status Collect(std::vector<Result<LoadedFrame>>& frames, LoadedFrames& result) {
  for (Result<LoadedFrame>& loaded : frames) {
    if (!loaded) {
      return tl::unexpected(loaded.error());
    }
    result.stack.push_back(std::move(loaded->frame));
    const LightFrame& frame = result.stack.back();
    if (Status status = CheckSize(frame.name, frame.rgb.Size(), result.stack[0].rgb.Size());
        !status) {
      return status;
    }
    result.srgb_count += loaded->was_srgb ? 1 : 0;
    result.sha256_of_input[frame.name] = loaded->sha256;
  }
  return {};
}

}  // namespace

Result<std::string> CheckedHash(const FrameFile& file) {
  Result<std::string> hash = Sha256OfFile(file.path);
  if (hash && file.sha256 && *file.sha256 != *hash) {
    return Fail(ErrorCode::kBadData,
                "{}: its SHA-256 is {} but the session recorded {}: the file has changed since the "
                "capture; restore it or capture again",
                file.path.string(), *hash, *file.sha256);
  }
  return hash;
}

Status CheckSize(const std::string& what, ImageSize size, ImageSize frame_size) {
  if (size == frame_size) {
    return {};
  }
  return Fail(ErrorCode::kBadData,
              "{}: is {} x {} px, but the first frame is {} x {} px; need one size", what,
              size.width, size.height, frame_size.width, frame_size.height);
}

Result<LoadedFrames> LoadFrames(const std::vector<FrameFile>& lit,
                                const std::vector<FrameFile>& dark, Encoding encoding,
                                const Task& task) {
  const auto count = static_cast<int>(lit.size());
  task.BeginStage("reading", count + static_cast<int>(dark.size()));
  std::vector<Result<LoadedFrame>> frames(lit.size());
  const Status ran = ParallelFor(count, 1, task, [&](int begin, int) {
    const auto k = static_cast<size_t>(begin);
    frames[k] = LoadFrame(lit[k], encoding);
  });
  if (!ran) {
    return tl::unexpected(ran.error());
  }
  LoadedFrames result;
  if (const Status status = Collect(frames, result); !status) {
    return tl::unexpected(status.error());
  }
  if (dark.empty()) {
    return result;
  }
  const Result<Image3> mean = MeanDark(dark, encoding, result.stack[0].rgb.Size(), task, result);
  if (!mean) {
    return tl::unexpected(mean.error());
  }
  for (LightFrame& frame : result.stack) {
    Subtract(*mean, frame);
  }
  return result;
}

}  // namespace sateen
