#include "calibration/spheres/sphere_outline.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "calibration/spheres/sphere_edges.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr std::array<double, 3> kBands = {0.08, 0.025, 0.012};  // of the radius, each way
constexpr double kTripleTolerance = 0.006;                      // of the radius
constexpr double kLeastRadiusPx = 8.0;
constexpr double kInterior = 0.97;  // of the radius

// Plane of equation (1), or the image itself without a camera.
class OutlinePlane {
 public:
  OutlinePlane(const std::optional<Camera>& camera, const Eigen::Vector3d& axis)
      : camera_(camera), axis_(axis), e1_(axis.unitOrthogonal()), e2_(axis.cross(e1_)) {}

  [[nodiscard]] std::optional<Eigen::Vector2d> FromPixel(const Eigen::Vector2d& px) const {
    if (!camera_) {
      return px;
    }
    const std::optional<Eigen::Vector3d> d = RayOfPixel(*camera_, px.x(), px.y());
    if (!d) {
      return std::nullopt;
    }
    return 2.0 / (1.0 + d->dot(axis_)) * Eigen::Vector2d(d->dot(e1_), d->dot(e2_));  // (1)
  }

  [[nodiscard]] Eigen::Vector2d ToPixel(const Eigen::Vector2d& q) const {
    return camera_ ? PixelOfTablePoint(*camera_, camera_->table_from_camera.translation() +
                                                     AtAngle(2.0 * std::atan(q.norm() / 2.0), q))
                   : q;
  }

  // Returns the unit ray at `angle` from the plane's axis, towards q.
  [[nodiscard]] Eigen::Vector3d AtAngle(double angle, const Eigen::Vector2d& q) const {
    const Eigen::Vector2d towards = q.norm() > 0.0 ? q.normalized() : Eigen::Vector2d::UnitX();
    return std::cos(angle) * axis_ + std::sin(angle) * (towards.x() * e1_ + towards.y() * e2_);
  }

 private:
  const std::optional<Camera>& camera_;
  Eigen::Vector3d axis_;
  Eigen::Vector3d e1_;
  Eigen::Vector3d e2_;
};

// Returns the pixels inside the rim after it is shrunk towards its centroid.
std::vector<PixelSpan> InteriorOf(const std::vector<Eigen::Vector2d>& rim,
                                  const Eigen::Vector2d& centroid) {
  double least = centroid.y();
  double most = centroid.y();
  for (const Eigen::Vector2d& px : rim) {
    least = std::min(least, centroid.y() + kInterior * (px - centroid).y());
    most = std::max(most, centroid.y() + kInterior * (px - centroid).y());
  }
  std::vector<PixelSpan> spans;
  spans.reserve(static_cast<size_t>(most - least) + 2);
  for (int y = static_cast<int>(std::ceil(least)); y <= static_cast<int>(most); ++y) {
    double left = centroid.x();
    double right = centroid.x();
    for (size_t i = 0; i < rim.size(); ++i) {
      const Eigen::Vector2d a = centroid + kInterior * (rim[i] - centroid);
      const Eigen::Vector2d b = centroid + kInterior * (rim[(i + 1) % rim.size()] - centroid);
      if ((a.y() <= y) != (b.y() <= y)) {
        const double x = a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
        left = std::min(left, x);
        right = std::max(right, x);
      }
    }
    spans.push_back({y, static_cast<int>(std::ceil(left)), static_cast<int>(right) + 1});
  }
  return spans;
}

// Fits a circle of the plane to a circle of the image.
std::optional<PlaneCircle> InPlane(const OutlinePlane& plane, const Circle& circle) {
  const std::optional<Eigen::Vector2d> center = plane.FromPixel(circle.center_px);
  const PlaneCircle in_image{circle.center_px, circle.radius_px};
  std::vector<RimEdge> rim;
  rim.reserve(kRimPoints);
  double radius = 0.0;
  for (int i = 0; i < kRimPoints; ++i) {
    const std::optional<Eigen::Vector2d> q = plane.FromPixel(in_image.At(i));
    if (!center || !q) {
      return std::nullopt;
    }
    rim.push_back({*q, i});
    radius += (*q - *center).norm() / kRimPoints;
  }
  return FitPlaneCircle(rim, {*center, radius}, radius);
}

// Fills in place and radius of the sphere, from the circle in the plane.
void Place(const OutlinePlane& plane, const PlaneCircle& circle, const SphereOptions& options,
           Sphere& sphere) {
  if (!options.camera) {
    sphere.center = {circle.center.x(), -circle.center.y(), 0.0};
    sphere.radius = circle.radius;
    return;
  }
  const double t = circle.center.norm();
  const double far_side = 2.0 * std::atan((t + circle.radius) / 2.0);
  const double near_side = 2.0 * std::atan((t - circle.radius) / 2.0);
  const Eigen::Vector3d axis = plane.AtAngle((far_side + near_side) / 2.0, circle.center);  // (3)
  const double w = (far_side - near_side) / 2.0;
  sphere.radius = options.radius_mm;
  sphere.center = options.camera->table_from_camera.translation() +
                  options.radius_mm / std::sin(w) * axis;  // (4)
}

bool IsCut(ImageSize size, const Eigen::Vector2d& px) {
  return !(px.x() >= 0.0 && px.y() >= 0.0 && px.x() <= size.width - 1.0 &&
           px.y() <= size.height - 1.0);
}

auto CutError(ImageSize size, const Circle& circle, std::string_view name) {
  return Fail(ErrorCode::kBadData,
              "{}: the sphere at ({:.0f}, {:.0f}) px of radius {:.0f} px is cut by the frame of "
              "{} x {} px; need all of it",
              name, circle.center_px.x(), circle.center_px.y(), circle.radius_px, size.width,
              size.height);
}

Status CheckCircle(ImageSize size, const Circle& circle, std::string_view name,
                   const SphereOptions& options) {
  if (Status status = options.Validate(); !status) {
    return status;
  }
  if (options.camera && options.camera->size_px != size) {
    return Fail(ErrorCode::kBadData, "{}: {} x {} px; the camera has {} x {}", name, size.width,
                size.height, options.camera->size_px.width, options.camera->size_px.height);
  }
  if (IsCut(size, circle.center_px)) {
    return CutError(size, circle, name);
  }
  if (!(circle.radius_px >= kLeastRadiusPx)) {
    return Fail(ErrorCode::kDegenerate,
                "{}: the sphere at ({:.0f}, {:.0f}) px has a radius of {:.1f} px; need {}", name,
                circle.center_px.x(), circle.center_px.y(), circle.radius_px, kLeastRadiusPx);
  }
  return {};
}

// Plane, and in it the circle of the rough one of the image.
struct OutlineStart {
  OutlinePlane plane;
  PlaneCircle circle;
};

Result<OutlineStart> StartAt(ImageSize size, const Circle& rough, std::string_view name,
                             const SphereOptions& options) {
  if (Status status = CheckCircle(size, rough, name, options); !status) {
    return tl::unexpected(status.error());
  }
  const std::optional<Eigen::Vector3d> axis =
      options.camera ? RayOfPixel(*options.camera, rough.center_px.x(), rough.center_px.y())
                     : Eigen::Vector3d(Eigen::Vector3d::UnitZ());
  const OutlinePlane plane(options.camera, axis.value_or(Eigen::Vector3d::UnitZ()));
  const std::optional<PlaneCircle> circle = axis ? InPlane(plane, rough) : std::nullopt;
  if (!circle) {
    return Fail(ErrorCode::kDegenerate,
                "{}: the camera's distortion cannot be undone round the sphere at ({:.0f}, {:.0f})",
                name, rough.center_px.x(), rough.center_px.y());
  }
  return OutlineStart{plane, *circle};
}

// Returns the sphere that has this circle of the plane as its outline.
Result<Sphere> SphereOf(const OutlinePlane& plane, const PlaneCircle& circle, ImageSize size,
                        std::string_view name, const SphereOptions& options) {
  Sphere sphere;
  std::vector<Eigen::Vector2d> rim(kRimPoints);
  for (int i = 0; i < kRimPoints; ++i) {
    rim[static_cast<size_t>(i)] = plane.ToPixel(circle.At(i));
    sphere.outline.center_px += rim[static_cast<size_t>(i)] / kRimPoints;
  }
  for (const Eigen::Vector2d& px : rim) {
    sphere.outline.radius_px += (px - sphere.outline.center_px).norm() / kRimPoints;
  }
  if (std::ranges::any_of(rim, [&](const Eigen::Vector2d& px) { return IsCut(size, px); })) {
    return CutError(size, sphere.outline, name);
  }
  sphere.interior = InteriorOf(rim, sphere.outline.center_px);
  sphere.rim = std::move(rim);
  Place(plane, circle, options, sphere);
  return sphere;
}

}  // namespace

Status SphereOptions::Validate() const {
  if (!(least_seen > 0.0 && least_seen <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "least_seen = {}; need 0 < least_seen <= 1",
                least_seen);
  }
  if (camera && !(radius_mm > 0.0 && std::isfinite(radius_mm))) {
    return Fail(ErrorCode::kInvalidArgument,
                "radius_mm = {}; need the sphere's radius, > 0, where the camera is known",
                radius_mm);
  }
  return camera ? camera->Validate("camera") : Status();
}

Result<Sphere> SphereFromCircle(const Circle& circle, ImageSize size, std::string_view name,
                                const SphereOptions& options) {
  return StartAt(size, circle, name, options).and_then([&](const OutlineStart& start) {
    return SphereOf(start.plane, start.circle, size, name, options);
  });
}

Result<Sphere> FindSphere(const Image<float>& gray, const Circle& rough, std::string_view name,
                          const SphereOptions& options) {
  const Result<OutlineStart> start = StartAt(gray.Size(), rough, name, options);
  if (!start) {
    return tl::unexpected(start.error());
  }
  const OutlinePlane& plane = start->plane;
  PlaneCircle circle = start->circle;
  std::vector<RimEdge> edges;
  for (const double band : kBands) {
    edges = EdgesAround(
        gray, [&](const Eigen::Vector2d& q) { return plane.ToPixel(q); }, circle, rough.radius_px,
        band);
    const double tolerance = std::min(kTripleTolerance, band / 2.0) * circle.radius;
    if (band == kBands.front()) {
      circle = BestOfTriples(edges, circle, tolerance);
    }
    circle = FitPlaneCircle(edges, circle, tolerance);
  }
  const double seen = ShareSeen(edges);
  if (!(seen >= options.least_seen)) {
    return Fail(ErrorCode::kDegenerate,
                "{}: {:.0f} % of the outline of the sphere at ({:.0f}, {:.0f}) px is seen; need "
                "{:.0f} %: light it from behind, or give a mask or its circle",
                name, 100.0 * seen, rough.center_px.x(), rough.center_px.y(),
                100.0 * options.least_seen);
  }
  Result<Sphere> sphere = SphereOf(plane, circle, gray.Size(), name, options);
  if (sphere) {
    double squares = 0.0;
    for (const RimEdge& edge : edges) {
      squares += circle.Off(edge.at) * circle.Off(edge.at);
    }
    sphere->seen = seen;
    sphere->residual_px = std::sqrt(squares / static_cast<double>(edges.size())) *
                          sphere->outline.radius_px / circle.radius;
  }
  return sphere;
}

}  // namespace sateen
