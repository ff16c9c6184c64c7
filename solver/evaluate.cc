#include "solver/evaluate.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/angle.h"

namespace sateen {
namespace {

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

bool IsSolved(const NormalField& field, size_t p) {
  return field.reason.pixels[p] == static_cast<uint8_t>(Reason::kSolved);
}

// Linear interpolation between order statistics; `sorted` is not empty.
double Quantile(const std::vector<double>& sorted, double q) {
  const double place = q * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

ErrorStatistics StatisticsOf(std::vector<double> errors) {
  if (errors.empty()) {
    return {};
  }
  std::sort(errors.begin(), errors.end());
  const double sum = std::accumulate(errors.begin(), errors.end(), 0.0);
  return {.count = static_cast<int64_t>(errors.size()),
          .mean = sum / static_cast<double>(errors.size()),
          .median = Quantile(errors, 0.5),
          .p99 = Quantile(errors, 0.99),
          .max = errors.back()};
}

}  // namespace

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
    const double angle_deg = std::atan2(n.cross(t).norm(), n.dot(t)) * kDegPerRad;
    errors_deg.push_back(angle_deg);
    if (map != nullptr) {
      map->pixels[p] = static_cast<float>(angle_deg);
    }
  }
  return StatisticsOf(std::move(errors_deg));
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
