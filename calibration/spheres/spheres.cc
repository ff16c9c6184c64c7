#include "calibration/spheres/spheres.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/linear_algebra.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr int kWeightRounds = 20;
constexpr double kNearlyParallel = 1e-9;  // least over greatest eigenvalue

// Normal matrix of (1) and its right side, for given distances.
struct RayNormal {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
};

RayNormal NormalOf(const std::vector<SphereRay>& rays, const std::vector<double>& distances) {
  RayNormal normal;
  for (size_t j = 0; j < rays.size(); ++j) {
    const Eigen::Vector3d& l = rays[j].direction;
    const Eigen::Matrix3d across =
        (Eigen::Matrix3d::Identity() - l * l.transpose()) / (distances[j] * distances[j]);
    normal.matrix += across;
    normal.right += across * rays[j].from;
  }
  return normal;
}

struct RayMeeting {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();  // inverse of the normal matrix
};

// Solves (1) for the point where the rays meet. Returns nothing where that is behind one of them.
std::optional<RayMeeting> MeetingOf(const std::vector<SphereRay>& rays) {
  std::vector<double> distances(rays.size(), 1.0);
  RayMeeting meeting;
  for (int round = 0; round < kWeightRounds; ++round) {
    const RayNormal normal = NormalOf(rays, distances);
    const Eigen::Vector3d eigenvalues = SymmetricEigenvalues(normal.matrix);
    if (!(eigenvalues[0] > kNearlyParallel * eigenvalues[2])) {
      return std::nullopt;
    }
    meeting.inverse = InverseOfSymmetric(normal.matrix);
    meeting.at = meeting.inverse * normal.right;
    for (size_t j = 0; j < rays.size(); ++j) {
      distances[j] = rays[j].direction.dot(meeting.at - rays[j].from);
      if (!(distances[j] > 0.0)) {
        return std::nullopt;
      }
    }
  }
  return meeting;
}

double SquaredAngle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double angle = AngleBetweenRad(a, b);
  return angle * angle;
}

}  // namespace

Status SphereLightOptions::Validate() const {
  if (!(most_position_sd > 0.0 && most_position_sd <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument,
                "most_position_sd = {}; need 0 < most_position_sd <= 1", most_position_sd);
  }
  if (!(ray_sd_rad > 0.0 && ray_sd_rad < 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "ray_sd_rad = {}; need 0 < ray_sd_rad < 1",
                ray_sd_rad);
  }
  if (!(most_residual_rad > 0.0 && most_residual_rad < 1.0)) {
    return Fail(ErrorCode::kInvalidArgument,
                "most_residual_rad = {}; need 0 < most_residual_rad < 1", most_residual_rad);
  }
  return {};
}

Result<SphereRay> ReflectedRay(const Sphere& sphere, const std::optional<Camera>& camera,
                               const Eigen::Vector2d& highlight_px) {
  const std::optional<Eigen::Vector3d> seen =
      camera ? RayOfPixel(*camera, highlight_px.x(), highlight_px.y())
             : std::optional<Eigen::Vector3d>(-Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d& d = seen.value_or(Eigen::Vector3d::Zero());
  const Eigen::Vector3d o =
      camera ? Eigen::Vector3d(camera->table_from_camera.translation())
             : Eigen::Vector3d(highlight_px.x(), -highlight_px.y(), 2.0 * sphere.radius);
  const Eigen::Vector3d to_center = sphere.center - o;
  const double along = to_center.dot(d);
  const double under_root = sphere.radius * sphere.radius - to_center.squaredNorm() + along * along;
  if (!seen || !(under_root > 0.0 && along > 0.0)) {
    return Fail(ErrorCode::kBadData,
                "the highlight at ({:.1f}, {:.1f}) px is not on the sphere at ({:.1f}, {:.1f}) px",
                highlight_px.x(), highlight_px.y(), sphere.outline.center_px.x(),
                sphere.outline.center_px.y());
  }
  const Eigen::Vector3d p = o + (along - std::sqrt(under_root)) * d;  // (1)
  const Eigen::Vector3d n = (p - sphere.center) / sphere.radius;
  const Eigen::Vector3d v = -d;
  return SphereRay{.from = p, .direction = (2.0 * n.dot(v) * n - v).normalized()};  // (2)
}

Result<SphereLight> LightFromRays(const std::vector<SphereRay>& rays, bool has_camera,
                                  std::string_view frame, const SphereLightOptions& options) {
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  if (rays.empty()) {
    return Fail(ErrorCode::kInvalidArgument, "{}: no highlight; need one in one sphere at least",
                frame);
  }
  SphereLight result;
  result.light.name = frame;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const SphereRay& ray : rays) {
    sum += ray.direction;
  }
  result.light.direction = sum.normalized();
  const auto residual = [&](const auto& way) {
    double squares = 0.0;
    for (const SphereRay& ray : rays) {
      squares += SquaredAngle(ray.direction, way(ray));
    }
    return std::sqrt(squares / static_cast<double>(rays.size()));
  };
  result.residual_rad = residual([&](const SphereRay&) { return result.light.direction; });
  result.light.direction_sd_deg = std::max(options.ray_sd_rad, result.residual_rad) / kRadPerDeg;
  const std::optional<RayMeeting> meeting =
      has_camera && rays.size() > 1 ? MeetingOf(rays) : std::nullopt;
  if (meeting) {
    const double missed =
        residual([&](const SphereRay& ray) { return Eigen::Vector3d(meeting->at - ray.from); });
    const auto count = static_cast<double>(rays.size());
    const double own = missed * std::sqrt(count / (2.0 * count - 3.0));  // two angles a ray, less 3
    const Eigen::Matrix3d covariance =
        meeting->inverse * std::pow(std::max(options.ray_sd_rad, own), 2);
    double distance_mm = 0.0;
    for (const SphereRay& ray : rays) {
      distance_mm += (meeting->at - ray.from).norm() / count;
    }
    if (std::sqrt(SymmetricEigenvalues(covariance)[2]) <= options.most_position_sd * distance_mm) {
      result.light.model = LightModel::kNear;
      result.light.position_mm = meeting->at;
      result.residual_rad = missed;
      result.position_sd_mm = covariance.diagonal().cwiseSqrt();
      result.light.position_sd_mm = result.position_sd_mm;
    }
  }
  if (result.residual_rad > options.most_residual_rad) {
    return Fail(ErrorCode::kDegenerate,
                "{}: the rays of {} spheres miss one lamp by {:.2f} degrees; need {:.2f}: is each "
                "highlight the lamp's, and the camera this one?",
                frame, rays.size(), result.residual_rad / kRadPerDeg,
                options.most_residual_rad / kRadPerDeg);
  }
  return result;
}

}  // namespace sateen
