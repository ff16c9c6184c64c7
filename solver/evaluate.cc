#include "solver/evaluate.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/angle.h"
#include "core/check.h"
#include "core/statistics.h"
#include "core/whole_number.h"
#include "solver/least_squares/pixel_system.h"

namespace sateen {
namespace {

constexpr double kLowPassSdMm = 6.62;  // sqrt(ln 2) / (2 pi) * 50 mm: half of the power passes
constexpr double kSquaresPerSd = 8.0;  // so fine that their size widens G by 0.1 %
constexpr double kReachSd = 4.0;       // G is cut off beyond it
constexpr double kLeastWeight = 0.2;   // share of G on compared pixels
constexpr double kWidestSd = 4.0;      // of G, in longest sides of the image: 2 % of G are on it
const double kLeastNz = std::cos(80.0 * kRadPerDeg);

Status CheckSize(const NormalField& field, const Image3& truth, const char* what) {
  const ImageSize found = truth.Size();
  const ImageSize needed = field.normal.Size();
  if (found != needed) {
    return Fail(ErrorCode::kBadData, "the true {} are {}x{} px but the solved ones {}x{} px", what,
                found.width, found.height, needed.width, needed.height);
  }
  return {};
}

Eigen::Vector3d VectorAt(const Image3& image, size_t p) {
  return {static_cast<double>(image[0].pixels[p]), static_cast<double>(image[1].pixels[p]),
          static_cast<double>(image[2].pixels[p])};
}

ErrorStatistics StatisticsOf(std::vector<double> errors) {
  if (errors.empty()) {
    return {};
  }
  std::sort(errors.begin(), errors.end());
  const double sum = std::accumulate(errors.begin(), errors.end(), 0.0);
  return {.count = static_cast<int64_t>(errors.size()),
          .mean = sum / static_cast<double>(errors.size()),
          .median = InterpolatedQuantile(errors, 0.5),
          .p99 = InterpolatedQuantile(errors, 0.99),
          .max = errors.back()};
}

// Number of pixels and sums of their slope errors in each square of `side`.
struct SlopeErrors {
  Image<double> count;
  Image<double> x;
  Image<double> y;

  explicit SlopeErrors(ImageSize size) : count(size), x(size), y(size) {}
};

SlopeErrors SumSlopeErrors(const NormalField& field, const Image3& true_normal, int side) {
  const ImageSize size = field.normal.Size();
  SlopeErrors sums({(size.width + side - 1) / side, (size.height + side - 1) / side});
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    const Eigen::Vector3d t = VectorAt(true_normal, p);
    const Eigen::Vector3d n = VectorAt(field.normal, p);
    if (!IsSolved(field, p) || !t.allFinite() || t.z() < kLeastNz || n.z() < kLeastNz) {
      continue;
    }
    const auto column = static_cast<int>(p % static_cast<size_t>(size.width)) / side;
    const auto row = static_cast<int>(p / static_cast<size_t>(size.width)) / side;
    sums.count.At(column, row) += 1.0;
    sums.x.At(column, row) += t.x() / t.z() - n.x() / n.z();
    sums.y.At(column, row) += t.y() / t.z() - n.y() / n.z();
  }
  return sums;
}

// Blurs the image by G along x and transposes it. Twice blurs along both.
Image<double> BlurredAndTransposed(const Image<double>& image, const std::vector<double>& g) {
  const int reach = static_cast<int>(g.size()) - 1;
  Image<double> blurred(image.height, image.width);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      double sum = 0.0;
      for (int i = std::max(0, x - reach); i <= std::min(image.width - 1, x + reach); ++i) {
        sum += g[static_cast<size_t>(std::abs(i - x))] * image.At(i, y);
      }
      blurred.At(y, x) = sum;
    }
  }
  return blurred;
}

}  // namespace

Result<ErrorStatistics> LowFrequencyErrorDeg(const NormalField& field, const Image3& true_normal,
                                             double pitch_mm) {
  SATEEN_CHECK(pitch_mm > 0.0);
  if (Status status = CheckSize(field, true_normal, "normals"); !status) {
    return tl::unexpected(status.error());
  }
  // Beside so wide a G the whole image is a speck: no pixel is compared.
  const ImageSize size = field.normal.Size();
  if (!(kLowPassSdMm / pitch_mm < kWidestSd * std::max(size.width, size.height))) {
    return ErrorStatistics{};
  }
  const int side = std::max(1, ClampedTo<int>(kLowPassSdMm / kSquaresPerSd / pitch_mm));
  const double sd = kLowPassSdMm / pitch_mm / side;  // in squares
  std::vector<double> g;
  for (int i = 0; i <= ClampedTo<int>(std::ceil(kReachSd * sd)); ++i) {
    g.push_back(std::exp(-0.5 * i * i / (sd * sd)));
  }
  const double g_sum = 2.0 * std::accumulate(g.begin(), g.end(), 0.0) - g[0];
  const double most = g_sum * g_sum * side * side;  // were every pixel compared
  const auto blur = [&](const Image<double>& image) {
    return BlurredAndTransposed(BlurredAndTransposed(image, g), g);
  };
  const SlopeErrors sums = SumSlopeErrors(field, true_normal, side);
  const Image<double> weight = blur(sums.count);
  const Image<double> x = blur(sums.x);
  const Image<double> y = blur(sums.y);
  std::vector<double> errors_deg;
  for (size_t p = 0; p < weight.pixels.size(); ++p) {
    if (sums.count.pixels[p] > 0.0 && weight.pixels[p] >= kLeastWeight * most) {
      errors_deg.push_back(std::atan(std::hypot(x.pixels[p], y.pixels[p]) / weight.pixels[p]) *
                           kDegPerRad);  // (1)
    }
  }
  return StatisticsOf(std::move(errors_deg));
}

Result<ErrorStatistics> AngularErrorDeg(const NormalField& field, const Image3& true_normal,
                                        Image<float>* map) {
  if (Status status = CheckSize(field, true_normal, "normals"); !status) {
    return tl::unexpected(status.error());
  }
  if (map != nullptr) {
    *map = Image<float>(field.normal.Size());
  }
  std::vector<double> errors_deg;
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    const Eigen::Vector3d t = VectorAt(true_normal, p);
    if (!IsSolved(field, p) || !t.allFinite() || t.isZero()) {
      continue;
    }
    const Eigen::Vector3d n = VectorAt(field.normal, p);
    const double angle_deg = AngleBetweenRad(n, t) * kDegPerRad;
    errors_deg.push_back(angle_deg);
    if (map != nullptr) {
      map->pixels[p] = static_cast<float>(angle_deg);
    }
  }
  return StatisticsOf(std::move(errors_deg));
}

Result<Image<float>> AlbedoErrorMap(const NormalField& field, const Image3& true_albedo,
                                    const std::array<uint8_t, 4>* cfa) {
  if (Status status = CheckSize(field, true_albedo, "albedos"); !status) {
    return tl::unexpected(status.error());
  }
  const auto width = static_cast<size_t>(field.reason.width);
  Image<float> map(field.reason.Size());
  for (size_t p = 0; p < map.pixels.size(); ++p) {
    const Eigen::Vector3d weights =
        cfa == nullptr ? LuminanceWeights()
                       : Eigen::Vector3d::Unit((*cfa)[p / width % 2 * 2 + p % width % 2]);
    const double truth = weights.dot(VectorAt(true_albedo, p));
    if (IsSolved(field, p) && truth > 0.0) {
      map.pixels[p] =
          static_cast<float>(std::abs(weights.dot(VectorAt(field.albedo, p)) - truth) / truth);
    }
  }
  return map;
}

Result<ErrorStatistics> RelativeAlbedoError(const NormalField& field, const Image3& true_albedo) {
  if (Status status = CheckSize(field, true_albedo, "albedos"); !status) {
    return tl::unexpected(status.error());
  }
  std::vector<double> errors;
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    if (!IsSolved(field, p)) {
      continue;
    }
    const Eigen::Vector3d found = VectorAt(field.albedo, p);
    const Eigen::Vector3d truth = VectorAt(true_albedo, p);
    for (Eigen::Index c = 0; c < 3; ++c) {
      if (truth[c] > 0.0) {
        errors.push_back(std::abs(found[c] - truth[c]) / truth[c]);
      }
    }
  }
  return StatisticsOf(std::move(errors));
}

}  // namespace sateen
