#include "calibration/spheres/sphere_highlight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/statistics.h"
#include "imaging/color.h"

namespace sateen {
namespace {

constexpr double kSmoothShare = 200.0;  // of the radius: the box's half width
constexpr double kLeastWindowPx = 1.5;
constexpr double kWindowShare = 0.5;  // of the blob's radius
constexpr int kShiftRounds = 200;
constexpr double kShiftDone = 1e-4;  // [px]
constexpr std::array<double, 3> kLuma = {0.2989, 0.587, 0.114};
constexpr double kLumaOfHighlight = 249.5 / 255.0;  // 250 of 255, rounded

// Interior of the sphere, cut out of a photograph.
struct SphereCrop {
  Eigen::Vector2d origin;     // pixel of the crop's (0, 0)
  cv::Mat1f smoothed;         // over a two-hundredth of the radius
  cv::Mat1b inside;           // 255 in the interior
  std::vector<float> values;  // of the interior
};

SphereCrop CropOf(const Image<float>& gray, const Sphere& sphere) {
  int x0 = gray.width;
  int x1 = 0;
  const int y0 = sphere.interior.front().y;
  for (const PixelSpan& span : sphere.interior) {
    x0 = std::min(x0, span.x_begin);
    x1 = std::max(x1, span.x_end);
  }
  const cv::Mat1f all(gray.height, gray.width, const_cast<float*>(gray.pixels.data()));
  const cv::Rect box(x0, y0, x1 - x0, static_cast<int>(sphere.interior.size()));
  SphereCrop crop{Eigen::Vector2d(x0, y0), {}, cv::Mat1b(box.size(), uint8_t{0}), {}};
  const int reach = std::max(1, static_cast<int>(sphere.outline.radius_px / kSmoothShare));
  cv::blur(all(box), crop.smoothed, cv::Size(2 * reach + 1, 2 * reach + 1), cv::Point(-1, -1),
           cv::BORDER_REPLICATE);
  for (const PixelSpan& span : sphere.interior) {
    crop.inside.row(span.y - y0).colRange(span.x_begin - x0, span.x_end - x0) = 255;
    const float* row = crop.smoothed[span.y - y0];
    crop.values.insert(crop.values.end(), row + span.x_begin - x0, row + span.x_end - x0);
  }
  return crop;
}

struct LampBlob {
  double light = 0.0;
  double pixels = 0.0;
  Eigen::Vector2d weighted = Eigen::Vector2d::Zero();

  [[nodiscard]] Eigen::Vector2d Center() const { return weighted / light; }
};

// Returns the 8-connected blobs above `level`, brightest first.
std::vector<LampBlob> BlobsOf(const SphereCrop& crop, float level) {
  cv::Mat1b bright = crop.inside.clone();
  std::transform(crop.smoothed.begin(), crop.smoothed.end(), bright.begin(), bright.begin(),
                 [&](float i, uint8_t inside) { return i > level ? inside : uint8_t{0}; });
  cv::Mat1i labels;
  std::vector<LampBlob> blobs(static_cast<size_t>(cv::connectedComponents(bright, labels)));
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (bright(y, x) != 0) {
        LampBlob& blob = blobs[static_cast<size_t>(labels(y, x))];
        const auto light = static_cast<double>(crop.smoothed(y, x) - level);
        blob.light += light;
        blob.pixels += 1.0;
        blob.weighted += light * Eigen::Vector2d(x, y);
      }
    }
  }
  blobs.erase(blobs.begin());  // the background
  std::ranges::stable_sort(blobs, std::greater<>(), &LampBlob::light);
  return blobs;
}

// Solves (2) from `c` on.
Eigen::Vector2d CenterByMeanShift(const SphereCrop& crop, Eigen::Vector2d c, double s,
                                  double level) {
  const double reach = 4.0 * s;
  for (int round = 0; round < kShiftRounds; ++round) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weights = 0.0;
    const auto first = [&](double at) { return std::max(0, static_cast<int>(at - reach)); };
    const int y_end = std::min(crop.smoothed.rows, static_cast<int>(c.y() + reach) + 2);
    const int x_end = std::min(crop.smoothed.cols, static_cast<int>(c.x() + reach) + 2);
    for (int y = first(c.y()); y < y_end; ++y) {
      for (int x = first(c.x()); x < x_end; ++x) {
        const auto i = static_cast<double>(crop.smoothed(y, x));
        if (crop.inside(y, x) != 0 && i > level) {
          const Eigen::Vector2d at(x, y);
          const double w = (i - level) * std::exp(-(at - c).squaredNorm() / (2.0 * s * s));
          sum += w * at;
          weights += w;
        }
      }
    }
    const Eigen::Vector2d next = sum / weights;
    const double moved = (next - c).norm();
    c = next;
    if (moved < kShiftDone) {
      break;
    }
  }
  return c;
}

Status CheckInside(ImageSize size, const Sphere& sphere, std::string_view frame) {
  const bool inside =
      !sphere.interior.empty() && std::ranges::all_of(sphere.interior, [&](const PixelSpan& span) {
        return span.y >= 0 && span.y < size.height && span.x_begin >= 0 &&
               span.x_end <= size.width && span.x_begin < span.x_end;
      });
  return inside ? Status()
                : Fail(ErrorCode::kBadData,
                       "{}: {} x {} px do not hold the sphere at ({:.0f}, {:.0f}) px; need a "
                       "photograph like the one it was found in",
                       frame, size.width, size.height, sphere.outline.center_px.x(),
                       sphere.outline.center_px.y());
}

// Fails if these blobs are not the image of one lamp.
Status CheckBlobs(const std::vector<LampBlob>& blobs, const SphereCrop& crop,
                  std::string_view frame, const HighlightOptions& options) {
  const double share = blobs[0].pixels / static_cast<double>(crop.values.size());
  const Eigen::Vector2d at = crop.origin + blobs[0].Center();
  if (share > options.most_area) {
    return Fail(ErrorCode::kDegenerate,
                "{}: the highlight at ({:.0f}, {:.0f}) px covers {:.1f} % of the sphere; a lamp "
                "covers at most {:.1f} %: darken the room, expose less",
                frame, at.x(), at.y(), 100.0 * share, 100.0 * options.most_area);
  }
  if (blobs.size() > 1 && blobs[1].light > options.most_runner_up * blobs[0].light) {
    const Eigen::Vector2d other = crop.origin + blobs[1].Center();
    return Fail(ErrorCode::kDegenerate,
                "{}: two highlights alike in one sphere, at ({:.0f}, {:.0f}) and ({:.0f}, {:.0f}) "
                "px, the second with {:.0f} % of the first one's light; need one lamp a frame",
                frame, at.x(), at.y(), other.x(), other.y(),
                100.0 * blobs[1].light / blobs[0].light);
  }
  return {};
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
  if (Status status =
          options.Validate().and_then([&] { return CheckInside(gray.Size(), sphere, frame); });
      !status) {
    return tl::unexpected(status.error());
  }
  const SphereCrop crop = CropOf(gray, sphere);
  const auto median = static_cast<double>(Median(crop.values));
  const auto peak = static_cast<double>(*std::ranges::max_element(crop.values));
  if (!(peak - median >= options.least_rise)) {
    return Fail(ErrorCode::kDegenerate,
                "{}: no highlight in the sphere at ({:.0f}, {:.0f}) px: its brightest place has "
                "{:.3f}, its median {:.3f} of full scale; need {:.3f} more: was the lamp on?",
                frame, sphere.outline.center_px.x(), sphere.outline.center_px.y(), peak, median,
                options.least_rise);
  }
  const auto level = static_cast<float>(median + options.level * (peak - median));  // (1)
  const std::vector<LampBlob> blobs = BlobsOf(crop, level);
  if (Status status = CheckBlobs(blobs, crop, frame, options); !status) {
    return tl::unexpected(status.error());
  }
  const double radius_px = std::sqrt(blobs[0].pixels / std::numbers::pi);
  const double s = std::max(kLeastWindowPx, kWindowShare * radius_px);
  const Eigen::Vector2d c =
      CenterByMeanShift(crop, blobs[0].Center(), s, (median + peak) / 2.0);  // (2)
  return Highlight{.at_px = crop.origin + c,
                   .peak = peak,
                   .radius_px = radius_px,
                   .area_share = blobs[0].pixels / static_cast<double>(crop.values.size()),
                   .runner_up = blobs.size() > 1 ? blobs[1].light / blobs[0].light : 0.0};
}

Result<Highlight> MedianHighlight(const Image3& photo, const Sphere& sphere,
                                  std::string_view frame) {
  if (Status status = CheckInside(photo.Size(), sphere, frame); !status) {
    return tl::unexpected(status.error());
  }
  std::vector<double> xs;
  std::vector<double> ys;
  double pixels = 0.0;
  for (const PixelSpan& span : sphere.interior) {
    for (int x = span.x_begin; x < span.x_end; ++x) {
      double luma = 0.0;
      for (size_t c = 0; c < 3; ++c) {
        luma += kLuma[c] * static_cast<double>(SrgbFromLinear(photo[c].At(x, span.y)));
      }
      pixels += 1.0;
      if (luma >= kLumaOfHighlight) {
        xs.push_back(x);
        ys.push_back(span.y);
      }
    }
  }
  if (xs.empty()) {
    return Fail(ErrorCode::kDegenerate,
                "{}: no pixel of the sphere at ({:.0f}, {:.0f}) px has a luma of 250 of 255; use "
                "the lamp's own highlight",
                frame, sphere.outline.center_px.x(), sphere.outline.center_px.y());
  }
  const auto count = static_cast<double>(xs.size());
  std::ranges::sort(xs);
  std::ranges::sort(ys);
  return Highlight{.at_px = {InterpolatedQuantile(xs, 0.5), InterpolatedQuantile(ys, 0.5)},
                   .peak = kLumaOfHighlight,
                   .radius_px = std::sqrt(count / std::numbers::pi),
                   .area_share = count / pixels,
                   .runner_up = 0.0};
}

}  // namespace sateen
