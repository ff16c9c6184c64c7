#include "calibration/spheres/sphere_edges.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <utility>

#include "core/gauss_newton.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr int kTriples = 2000;
constexpr double kFarthest = 0.16;  // distance of a centre from the rough one, in radii
constexpr int kCircleRounds = 8;
constexpr double kLeastEdge = 5e-4;     // of full scale, per pixel
constexpr double kSecondaryEdge = 0.3;  // of the strongest edge along the same radius
constexpr double kEdgeOutlier = 3.0;    // standard deviations

// Interpolates the brightness between pixels; outside it is that of the border.
double SampleAt(const Image<float>& gray, const Eigen::Vector2d& px) {
  const double x = std::clamp(px.x(), 0.0, gray.width - 1.0);
  const double y = std::clamp(px.y(), 0.0, gray.height - 1.0);
  const int x0 = std::min(static_cast<int>(x), gray.width - 2);
  const int y0 = std::min(static_cast<int>(y), gray.height - 2);
  const double fx = x - x0;
  const double fy = y - y0;
  const auto at = [&](int i, int j) { return static_cast<double>(gray.At(i, j)); };
  return (1 - fy) * ((1 - fx) * at(x0, y0) + fx * at(x0 + 1, y0)) +
         fy * ((1 - fx) * at(x0, y0 + 1) + fx * at(x0 + 1, y0 + 1));
}

// Returns the slope along a profile, by the derivative of a Gaussian of `sigma` steps.
std::vector<double> SlopesOf(const std::vector<double>& profile, double sigma) {
  const int reach = static_cast<int>(std::ceil(3.0 * sigma));
  std::vector<double> slopes(profile.size(), 0.0);
  double norm = 0.0;
  for (int k = 1; k <= reach; ++k) {
    norm += 2.0 * k * k * std::exp(-0.5 * k * k / (sigma * sigma));
  }
  for (int i = reach; i + reach < static_cast<int>(profile.size()); ++i) {
    double sum = 0.0;
    for (int k = 1; k <= reach; ++k) {
      sum += k * std::exp(-0.5 * k * k / (sigma * sigma)) *
             (profile[static_cast<size_t>(i) + static_cast<size_t>(k)] -
              profile[static_cast<size_t>(i) - static_cast<size_t>(k)]);
    }
    slopes[static_cast<size_t>(i)] = sum / norm;
  }
  return slopes;
}

std::optional<PlaneCircle> ThroughThree(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                                        const Eigen::Vector2d& c) {
  Eigen::Matrix2d sides;
  sides << (b - a).transpose(), (c - a).transpose();
  if (std::abs(sides.determinant()) <= 1e-6 * (b - a).norm() * (c - a).norm()) {
    return std::nullopt;
  }
  const Eigen::Vector2d center =
      a + sides.inverse() * Eigen::Vector2d((b - a).squaredNorm(), (c - a).squaredNorm()) / 2.0;
  return PlaneCircle{center, (a - center).norm()};
}

// Returns the number of radii with an edge within `tolerance` of the circle.
int RimsSeen(const std::vector<RimEdge>& edges, const PlaneCircle& circle, double tolerance) {
  int seen = 0;
  int last = -1;
  for (const RimEdge& edge : edges) {
    if (edge.rim != last && std::abs(circle.Off(edge.at)) <= tolerance) {
      last = edge.rim;
      ++seen;
    }
  }
  return seen;
}

}  // namespace

Eigen::Vector2d PlaneCircle::At(int rim, double scale) const {
  const double angle = 2.0 * std::numbers::pi * rim / kRimPoints;
  return center + scale * radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
}

std::vector<RimEdge> EdgesAround(const Image<float>& gray, const PixelOfPlane& pixel_of,
                                 const PlaneCircle& circle, double radius_px, double band) {
  const double sigma_px = std::clamp(radius_px / 200.0, 0.8, 3.0);
  const double step_px = 0.5;
  const int half = static_cast<int>(std::ceil((band * radius_px + 3.0 * sigma_px) / step_px)) + 2;
  const double step = step_px / radius_px;
  std::vector<RimEdge> edges;
  edges.reserve(size_t{2} * kRimPoints);
  std::vector<double> profile(static_cast<size_t>(2 * half + 1));
  for (int rim = 0; rim < kRimPoints; ++rim) {
    for (int i = -half; i <= half; ++i) {
      const Eigen::Vector2d q = circle.At(rim, 1.0 + i * step);
      profile[static_cast<size_t>(i) + static_cast<size_t>(half)] = SampleAt(gray, pixel_of(q));
    }
    std::vector<double> slopes = SlopesOf(profile, sigma_px / step_px);
    for (double& slope : slopes) {
      slope = std::abs(slope) / step_px;
    }
    const double least = std::max(kLeastEdge, kSecondaryEdge * *std::ranges::max_element(slopes));
    for (size_t i = 1; i + 1 < slopes.size(); ++i) {
      if (slopes[i] < least || slopes[i] < slopes[i - 1] || slopes[i] <= slopes[i + 1]) {
        continue;
      }
      const double bend = slopes[i - 1] - 2.0 * slopes[i] + slopes[i + 1];
      const double between = bend < 0.0 ? 0.5 * (slopes[i - 1] - slopes[i + 1]) / bend : 0.0;
      const double scale = 1.0 + (static_cast<double>(i) - half + between) * step;
      edges.push_back({circle.At(rim, scale), rim, slopes[i]});
    }
  }
  return edges;
}

PlaneCircle BestOfTriples(const std::vector<RimEdge>& edges, const PlaneCircle& rough,
                          double tolerance) {
  std::mt19937 random(1);
  PlaneCircle best = rough;
  int most = 0;
  for (int triple = 0; triple < kTriples && edges.size() > 3; ++triple) {
    const auto any = [&]() -> const Eigen::Vector2d& { return edges[random() % edges.size()].at; };
    const std::optional<PlaneCircle> circle = ThroughThree(any(), any(), any());
    if (!circle || (circle->center - rough.center).norm() > kFarthest * rough.radius) {
      continue;
    }
    const int seen = RimsSeen(edges, *circle, tolerance);
    if (seen > most) {
      most = seen;
      best = *circle;
    }
  }
  return best;
}

PlaneCircle FitPlaneCircle(std::vector<RimEdge>& edges, PlaneCircle circle, double tolerance) {
  std::vector<RimEdge> used;
  for (int round = 0; round < kCircleRounds; ++round) {
    used.clear();
    NormalEquations<3> equations;
    std::vector<double> sizes;
    sizes.reserve(edges.size());
    used.reserve(edges.size());
    for (const RimEdge& edge : edges) {
      const double off = circle.Off(edge.at);
      if (std::abs(off) > tolerance) {
        continue;
      }
      const Eigen::Vector2d out = (edge.at - circle.center).normalized();
      equations.Add({out.x(), out.y(), 1.0}, off, edge.slope);
      sizes.push_back(std::abs(off));
      used.push_back(edge);
    }
    if (used.size() < 8) {
      break;
    }
    const Eigen::Vector3d change = SolveNormal<3>(equations.information, equations.gradient);
    circle.center += change.head<2>();
    circle.radius += change[2];
    tolerance = std::clamp(kEdgeOutlier * kSdPerMad * Median(std::move(sizes)),
                           2e-4 * circle.radius, tolerance);
  }
  edges = std::move(used);
  return circle;
}

double ShareSeen(const std::vector<RimEdge>& edges) {
  return static_cast<double>(RimsSeen(edges, {}, std::numeric_limits<double>::infinity())) /
         kRimPoints;
}

}  // namespace sateen
