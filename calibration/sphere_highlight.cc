#include "calibration/sphere_highlight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace sateen {
namespace {

constexpr double kSmoothShare = 200.0;  // of the radius: the box's half width
constexpr float kFullScale = 0.99F;

// The sphere's pixels and a margin, cut out; -1 where a pixel is not of its interior.
struct SphereCrop {
  int x0 = 0;
  int y0 = 0;
  Image<float> value;     // as photographed
  Image<float> smoothed;  // over the interior alone
};

// Sums of each run of 2 reach + 1 values, those below zero apart, over how many they are.
void SmoothLines(Image<float>& image, int reach, bool columns) {
  const int length = columns ? image.height : image.width;
  const int lines = columns ? image.width : image.height;
  std::vector<float> line(static_cast<size_t>(length));
  for (int n = 0; n < lines; ++n) {
    const auto at = [&](int i) -> float& { return columns ? image.At(n, i) : image.At(i, n); };
    for (int i = 0; i < length; ++i) {
      line[static_cast<size_t>(i)] = at(i);
    }
    for (int i = 0; i < length; ++i) {
      float sum = 0.0F;
      int count = 0;
      for (int k = std::max(0, i - reach); k <= std::min(length - 1, i + reach); ++k) {
        if (line[static_cast<size_t>(k)] >= 0.0F) {
          sum += line[static_cast<size_t>(k)];
          ++count;
        }
      }
      if (at(i) >= 0.0F) {
        at(i) = sum / static_cast<float>(count);
      }
    }
  }
}

SphereCrop CropOf(const Image<float>& gray, const Sphere& sphere) {
  SphereCrop crop;
  int x1 = 0;
  crop.x0 = gray.width;
  crop.y0 = sphere.interior.front().y;
  for (const PixelSpan& span : sphere.interior) {
    crop.x0 = std::min(crop.x0, span.x_begin);
    x1 = std::max(x1, span.x_end);
  }
  crop.value = Image<float>(x1 - crop.x0, static_cast<int>(sphere.interior.size()), -1.0F);
  for (const PixelSpan& span : sphere.interior) {
    for (int x = span.x_begin; x < span.x_end; ++x) {
      crop.value.At(x - crop.x0, span.y - crop.y0) = std::max(0.0F, gray.At(x, span.y));
    }
  }
  crop.smoothed = crop.value;
  const int reach = std::max(1, static_cast<int>(sphere.outline.radius_px / kSmoothShare));
  SmoothLines(crop.smoothed, reach, false);
  SmoothLines(crop.smoothed, reach, true);
  return crop;
}

struct LampBlob {
  double light = 0.0;
  Eigen::Vector2d weighted = Eigen::Vector2d::Zero();
  double pixels = 0.0;
  double saturated = 0.0;

  [[nodiscard]] Eigen::Vector2d Center() const { return weighted / light; }
};

// Takes the 8-connected blob of pixels above `level` at (x, y) out of `open`.
LampBlob TakeBlob(const SphereCrop& crop, Image<float>& open, int x, int y, float level) {
  LampBlob blob;
  std::vector<std::array<int, 2>> queue = {{x, y}};
  open.At(x, y) = -1.0F;
  for (size_t next = 0; next < queue.size(); ++next) {
    const auto [px, py] = queue[next];
    const double light = crop.smoothed.At(px, py) - level;
    blob.light += light;
    blob.weighted += light * Eigen::Vector2d(px + crop.x0, py + crop.y0);
    blob.pixels += 1.0;
    blob.saturated += crop.value.At(px, py) >= kFullScale ? 1.0 : 0.0;
    for (int j = std::max(0, py - 1); j <= std::min(open.height - 1, py + 1); ++j) {
      for (int i = std::max(0, px - 1); i <= std::min(open.width - 1, px + 1); ++i) {
        if (open.At(i, j) > level) {
          open.At(i, j) = -1.0F;
          queue.push_back({i, j});
        }
      }
    }
  }
  return blob;
}

// Brightest first.
std::vector<LampBlob> BlobsOf(const SphereCrop& crop, float level) {
  Image<float> open = crop.smoothed;
  std::vector<LampBlob> blobs;
  blobs.reserve(64);
  for (int y = 0; y < open.height; ++y) {
    for (int x = 0; x < open.width; ++x) {
      if (open.At(x, y) > level) {
        blobs.push_back(TakeBlob(crop, open, x, y, level));
      }
    }
  }
  std::ranges::stable_sort(blobs, std::greater<>(), &LampBlob::light);
  return blobs;
}

Status CheckInside(const Image<float>& gray, const Sphere& sphere, std::string_view frame) {
  const bool inside =
      !sphere.interior.empty() && std::ranges::all_of(sphere.interior, [&](const PixelSpan& span) {
        return span.y >= 0 && span.y < gray.height && span.x_begin >= 0 &&
               span.x_end <= gray.width && span.x_begin < span.x_end;
      });
  return inside ? Status()
                : Fail(ErrorCode::kBadData,
                       "{}: {} x {} px do not hold the sphere at ({:.0f}, {:.0f}) px; need a "
                       "photograph like the one it was found in",
                       frame, gray.width, gray.height, sphere.outline.center_px.x(),
                       sphere.outline.center_px.y());
}

}  // namespace

Status HighlightOptions::Validate() const {
  if (!(least_rise > 0.0 && least_rise < 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "least_rise = {}; need 0 < least_rise < 1",
                least_rise);
  }
  if (!(level >= 0.3 && level <= 0.95)) {
    return Fail(ErrorCode::kInvalidArgument, "level = {}; need 0.3 to 0.95", level);
  }
  if (!(most_area > 0.0 && most_area <= 0.5)) {
    return Fail(ErrorCode::kInvalidArgument, "most_area = {}; need 0 < most_area <= 0.5",
                most_area);
  }
  if (!(most_runner_up > 0.0 && most_runner_up <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "most_runner_up = {}; need 0 < most_runner_up <= 1",
                most_runner_up);
  }
  return {};
}

Result<Highlight> FindHighlight(const Image<float>& gray, const Sphere& sphere,
                                std::string_view frame, const HighlightOptions& options) {
  if (Status status = options.Validate().and_then([&] { return CheckInside(gray, sphere, frame); });
      !status) {
    return tl::unexpected(status.error());
  }
  const SphereCrop crop = CropOf(gray, sphere);
  std::vector<float> values;
  values.reserve(crop.smoothed.pixels.size());
  std::ranges::copy_if(crop.smoothed.pixels, std::back_inserter(values),
                       [](float value) { return value >= 0.0F; });
  const auto area = static_cast<double>(values.size());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  const double median = *middle;
  const double peak = *std::ranges::max_element(values);
  if (!(peak - median >= options.least_rise)) {
    return Fail(ErrorCode::kDegenerate,
                "{}: no highlight in the sphere at ({:.0f}, {:.0f}) px: its brightest place has "
                "{:.3f}, its median {:.3f} of full scale; need {:.3f} more: was the lamp on?",
                frame, sphere.outline.center_px.x(), sphere.outline.center_px.y(), peak, median,
                options.least_rise);
  }
  const auto level = static_cast<float>(median + options.level * (peak - median));
  const std::vector<LampBlob> blobs = BlobsOf(crop, level);
  const LampBlob& lamp = blobs.front();
  const Eigen::Vector2d at = lamp.Center();
  if (lamp.pixels > options.most_area * area) {
    return Fail(ErrorCode::kDegenerate,
                "{}: the highlight at ({:.0f}, {:.0f}) px covers {:.1f} % of the sphere; a lamp "
                "covers at most {:.1f} %: darken the room, expose less",
                frame, at.x(), at.y(), 100.0 * lamp.pixels / area, 100.0 * options.most_area);
  }
  const double runner_up = blobs.size() > 1 ? blobs[1].light / lamp.light : 0.0;
  if (runner_up > options.most_runner_up) {
    const Eigen::Vector2d other = blobs[1].Center();
    return Fail(ErrorCode::kDegenerate,
                "{}: two highlights alike in one sphere, at ({:.0f}, {:.0f}) and ({:.0f}, {:.0f}) "
                "px, the second with {:.0f} % of the first one's light; need one lamp a frame",
                frame, at.x(), at.y(), other.x(), other.y(), 100.0 * runner_up);
  }
  return Highlight{.at_px = at,
                   .peak = peak,
                   .area_share = lamp.pixels / area,
                   .runner_up = runner_up,
                   .saturated = lamp.saturated / lamp.pixels};
}

}  // namespace sateen
