#include "scanner/sessions/frames/light_reader.h"

#include <limits>
#include <optional>
#include <utility>

#include "imaging/raw.h"
#include "scanner/sessions/frames/exposure_merge.h"
#include "scanner/sessions/frames/frame_loader.h"
#include "scanner/sessions/frames/sensor_reading.h"

namespace sateen {
namespace {

// Times the radiance at which the last channel saturates. A saturated site must not pass as a mean
// of it and its neighbours: whatever pixel it has a part in, at least a quarter, comes out above.
constexpr float kSaturatedSite = 8.0F;

size_t ColourAt(const RawMosaic& mosaic, int x, int y) {
  return mosaic.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)];
}

Image3 Scaled(Image3 rgb, double by) {
  for (Image<float>& plane : rgb.planes) {
    for (float& value : plane.pixels) {
      value *= static_cast<float>(by);
    }
  }
  return rgb;
}

// One RAW file.
Result<LightFrame> DevelopOne(const FrameFile& file, RawMosaic mosaic) {
  return ReadingOf(file, mosaic).map([&](const SensorReading& reading) {
    const float top = reading.FullScale();
    for (int y = 0; y < mosaic.samples.height; ++y) {
      for (int x = 0; x < mosaic.samples.width; ++x) {
        float& site = mosaic.samples.At(x, y);
        site = site >= reading.saturation ? kSaturatedSite * top
                                          : reading.Value(site, ColourAt(mosaic, x, y));
      }
    }
    const double per_exposure = 1.0 / file.exposure;
    return LightFrame{.rgb = Scaled(Demosaic(mosaic), per_exposure),
                      .full_scale = top * static_cast<float>(per_exposure),
                      .raw = true};
  });
}

// The mosaics of one light, from the longest exposure to the shortest, as one of radiance.
Result<LightFrame> DevelopSeveral(const LightFiles& files) {
  std::optional<ExposureMerge> merge;
  RawMosaic last;
  ImageSize size_px;
  SensorReading reading;
  for (const FrameFile& file : files) {
    Result<RawMosaic> mosaic = ReadRawMosaic(file.path, file.limit);
    if (!mosaic) {
      return tl::unexpected(mosaic.error());
    }
    const Result<SensorReading> of_file = ReadingOf(file, *mosaic);
    if (!of_file) {
      return tl::unexpected(of_file.error());
    }
    reading = *of_file;
    last = *std::move(mosaic);
    if (const Status same = CheckSize(file.path.string(), last.samples.Size(),
                                      merge ? size_px : last.samples.Size());
        !same) {
      return tl::unexpected(same.error());
    }
    if (!merge) {
      size_px = last.samples.Size();
      merge.emplace(last.samples.Size(), 2);
    }
    for (float& site : last.samples.pixels) {
      site = site >= reading.saturation ? std::numeric_limits<float>::infinity()
                                        : site + reading.shift;
    }
    merge->Add(last.samples, file.exposure, std::numeric_limits<float>::infinity(),
               NoiseOf(last, file.response ? &*file.response : nullptr));
  }
  const auto full_scale = reading.FullScale() / static_cast<float>(files.back().exposure);
  const float saturated = std::numeric_limits<float>::infinity();
  last.samples = merge->Radiance(saturated);
  for (int y = 0; y < last.samples.height; ++y) {
    for (int x = 0; x < last.samples.width; ++x) {
      float& site = last.samples.At(x, y);
      site = site == saturated ? kSaturatedSite * full_scale
                               : reading.balance[ColourAt(last, x, y)] * site;
    }
  }
  return LightFrame{.rgb = Demosaic(last), .full_scale = full_scale, .raw = true, .merged = true};
}

// Images, one or several.
Result<LightFrame> MergePhotos(const LightFiles& files, Encoding encoding, bool& was_srgb) {
  std::vector<ExposureMerge> merges;
  LightFrame frame;
  frame.merged = files.size() > 1;
  std::optional<float> saturation;
  for (const FrameFile& file : files) {
    const Result<Photo> photo = ReadPhoto(file.path, encoding, file.limit);
    if (!photo) {
      return tl::unexpected(photo.error());
    }
    if (!merges.empty()) {
      const Status same = CheckSize(file.path.string(), photo->rgb.Size(), frame.rgb.Size());
      if (!same) {
        return tl::unexpected(same.error());
      }
    }
    if (merges.empty()) {
      frame.rgb = Image3(photo->rgb.Size());
    }
    was_srgb = was_srgb || photo->was_srgb;
    saturation = photo->saturation;
    merges.resize(3, ExposureMerge(photo->rgb.Size(), 1));
    for (size_t c = 0; c < 3; ++c) {
      merges[c].Add(photo->rgb[c], file.exposure,
                    saturation.value_or(std::numeric_limits<float>::infinity()), {});
    }
  }
  const SensorReading reading = ReadingOf(files.front());
  if (saturation) {
    frame.full_scale = reading.Largest() * *saturation / static_cast<float>(files.back().exposure);
  }
  for (size_t c = 0; c < 3; ++c) {
    const float saturated = std::numeric_limits<float>::infinity();
    frame.rgb[c] = merges[c].Radiance(saturated);
    for (float& value : frame.rgb[c].pixels) {
      value = value == saturated ? frame.full_scale : reading.balance[c] * value;
    }
  }
  return frame;
}

// Fails if the files differ in kind or size: such files cannot be merged.
Status CheckAlike(const LightFiles& files) {
  for (const FrameFile& file : files) {
    if (IsRawName(file.path) != IsRawName(files.front().path)) {
      return Fail(ErrorCode::kBadData,
                  "{}: is to be merged with {}, but one is camera RAW and the other is not; need "
                  "frames of one kind for a light",
                  file.path.string(), files.front().path.string());
    }
  }
  return {};
}

}  // namespace

Result<LightReading> ReadLight(const LightFiles& files, Encoding encoding) {
  LightReading light;
  for (const FrameFile& file : files) {
    Result<std::string> hash = CheckedHash(file);
    if (!hash) {
      return tl::unexpected(hash.error());
    }
    light.sha256_of_input[file.path.string()] = *std::move(hash);
  }
  if (const Status status = CheckAlike(files); !status) {
    return tl::unexpected(status.error());
  }
  const FrameFile& first = files.front();
  Result<LightFrame> frame;
  if (!IsRawName(first.path)) {
    frame = MergePhotos(files, encoding, light.was_srgb);
  } else if (files.size() > 1) {
    frame = DevelopSeveral(files);
  } else {
    frame = ReadRawMosaic(first.path, first.limit).and_then([&](RawMosaic mosaic) {
      return DevelopOne(first, std::move(mosaic));
    });
  }
  if (!frame) {
    return tl::unexpected(frame.error());
  }
  light.frame = *std::move(frame);
  light.frame.name = first.path.string();
  return light;
}

}  // namespace sateen
