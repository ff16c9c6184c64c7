#include "calibration/spheres/sphere_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace sateen {
namespace {

constexpr int kSearchSizePx = 256;
constexpr int kLeastSidePx = 16;
constexpr int kBins = 72;           // directions round a centre
constexpr double kLeastSeen = 0.4;  // share of them
constexpr double kAlikeSeen = 0.8;  // of the best, where their number is not known
constexpr double kAlikeRadius = 0.5;
constexpr double kLeastRadius = 0.05;  // of the shorter side
constexpr double kMostRadius = 0.6;
constexpr int kCandidates = 40;        // centres that are tried
constexpr double kAligned = 0.94;      // cosine between gradient and radius
constexpr double kStrongShare = 0.12;  // of the pixels, by gradient
constexpr int kDustShare = 20;

// Returns the square roots of the means of blocks of `step` pixels, so that dim edges count, too.
Image<float> Reduced(const Image<float>& gray, int step) {
  Image<float> small(gray.width / step, gray.height / step);
  const auto block = static_cast<float>(step * step);
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      float sum = 0.0F;
      for (int j = 0; j < step; ++j) {
        for (int i = 0; i < step; ++i) {
          sum += gray.At(x * step + i, y * step + j);
        }
      }
      small.At(x, y) = std::sqrt(std::max(0.0F, sum / block));
    }
  }
  return small;
}

struct GradientEdge {
  Eigen::Vector2d at;
  Eigen::Vector2d across;  // unit
  double strength;
};

// Returns pixels of strong gradient that are the strongest along it.
std::vector<GradientEdge> GradientEdges(const Image<float>& small) {
  Image<float> strength(small.Size());
  std::vector<Eigen::Vector2d> across(small.pixels.size(), Eigen::Vector2d::Zero());
  for (int y = 1; y + 1 < small.height; ++y) {
    for (int x = 1; x + 1 < small.width; ++x) {
      const auto side = [&](int dx, int dy) {  // Sobel
        return small.At(x + dx + dy, y + dy + dx) + 2.0F * small.At(x + dx, y + dy) +
               small.At(x + dx - dy, y + dy - dx);
      };
      const Eigen::Vector2d gradient(side(1, 0) - side(-1, 0), side(0, 1) - side(0, -1));
      strength.At(x, y) = static_cast<float>(gradient.norm());
      if (gradient.norm() > 0.0) {
        across[small.Index(x, y)] = gradient.normalized();
      }
    }
  }
  std::vector<float> sorted = strength.pixels;
  const auto nth = sorted.begin() + static_cast<std::ptrdiff_t>((1.0 - kStrongShare) *
                                                                static_cast<double>(sorted.size()));
  std::nth_element(sorted.begin(), nth, sorted.end());
  const float least = std::max(*nth, 1e-4F);
  std::vector<GradientEdge> edges;
  edges.reserve(sorted.size() / 4);
  for (int y = 1; y + 1 < small.height; ++y) {
    for (int x = 1; x + 1 < small.width; ++x) {
      const Eigen::Vector2d& g = across[small.Index(x, y)];
      const int dx = static_cast<int>(std::lround(g.x()));
      const int dy = static_cast<int>(std::lround(g.y()));
      const float here = strength.At(x, y);
      if (here >= least && here >= strength.At(x + dx, y + dy) &&
          here >= strength.At(x - dx, y - dy)) {
        edges.push_back({{x, y}, g, static_cast<double>(here)});
      }
    }
  }
  return edges;
}

// Returns the votes of all edges for centres along their gradients, both ways.
Image<float> CenterVotes(const std::vector<GradientEdge>& edges, ImageSize size, int least,
                         int most) {
  Image<float> votes(size);
  for (const GradientEdge& edge : edges) {
    for (int radius = -most; radius <= most; ++radius) {
      const Eigen::Vector2d at = edge.at + radius * edge.across;
      const auto x = static_cast<int>(std::lround(at.x()));
      const auto y = static_cast<int>(std::lround(at.y()));
      if (std::abs(radius) >= least && x >= 0 && y >= 0 && x < size.width && y < size.height) {
        votes.At(x, y) += 1.0F / static_cast<float>(std::abs(radius));
      }
    }
  }
  Image<float> smooth(size);
  for (int y = 1; y + 1 < size.height; ++y) {
    for (int x = 1; x + 1 < size.width; ++x) {
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) {
          smooth.At(x, y) += votes.At(x + i, y + j);
        }
      }
    }
  }
  return smooth;
}

struct SeenCircle {
  Circle circle;
  double seen;
};

// Returns the circle about this centre with an edge in most directions.
SeenCircle BestRadius(const std::vector<GradientEdge>& edges, const Eigen::Vector2d& center,
                      int least, int most) {
  std::vector<std::array<bool, kBins>> hit(static_cast<size_t>(most) + 2);
  for (const GradientEdge& edge : edges) {
    const Eigen::Vector2d out = edge.at - center;
    const double distance = out.norm();
    if (distance < least || distance > most ||
        std::abs(out.dot(edge.across)) < kAligned * distance) {
      continue;
    }
    const double turn = (std::atan2(out.y(), out.x()) + std::numbers::pi) / (2 * std::numbers::pi);
    const auto bin = std::min<size_t>(static_cast<size_t>(turn * kBins), kBins - 1);
    const auto ring = static_cast<size_t>(std::lround(distance));
    for (size_t r = ring - 1; r <= ring + 1; ++r) {
      hit[r][bin] = true;
    }
  }
  SeenCircle best{{center, 0.0}, 0.0};
  for (auto r = static_cast<size_t>(least); r <= static_cast<size_t>(most); ++r) {
    const double seen = static_cast<double>(std::ranges::count(hit[r], true)) / kBins;
    if (seen > best.seen) {
      best = {{center, static_cast<double>(r)}, seen};
    }
  }
  return best;
}

bool Overlap(const Circle& a, const Circle& b) {
  return (a.center_px - b.center_px).norm() < 0.9 * std::max(a.radius_px, b.radius_px);
}

// Takes the pixels 4-connected to (x, y) out of the mask, and returns them.
std::vector<Eigen::Vector2i> TakeRegion(Mask& mask, int x, int y) {
  std::vector<Eigen::Vector2i> region = {{x, y}};
  mask.At(x, y) = 0;
  for (size_t next = 0; next < region.size(); ++next) {
    const Eigen::Vector2i at = region[next];
    for (const Eigen::Vector2i& step : {Eigen::Vector2i(1, 0), Eigen::Vector2i(-1, 0),
                                        Eigen::Vector2i(0, 1), Eigen::Vector2i(0, -1)}) {
      const Eigen::Vector2i to = at + step;
      if (to.x() >= 0 && to.y() >= 0 && to.x() < mask.width && to.y() < mask.height &&
          mask.At(to.x(), to.y()) != 0) {
        mask.At(to.x(), to.y()) = 0;
        region.push_back(to);
      }
    }
  }
  return region;
}

}  // namespace

Image<float> MeanOfPlanes(const Image3& photo) {
  Image<float> gray(photo.Size());
  for (size_t i = 0; i < gray.pixels.size(); ++i) {
    gray.pixels[i] = (photo[0].pixels[i] + photo[1].pixels[i] + photo[2].pixels[i]) / 3.0F;
  }
  return gray;
}

Image<float> AsPhotograph(const Mask& mask) {
  Image<float> gray(mask.Size());
  std::ranges::transform(mask.pixels, gray.pixels.begin(),
                         [](uint8_t inside) { return inside != 0 ? 1.0F : 0.0F; });
  return gray;
}

Result<std::vector<Circle>> CirclesInMask(const Mask& mask, int count, std::string_view name) {
  Mask rest = mask;
  std::vector<Circle> circles;
  circles.reserve(16);
  for (int y = 0; y < rest.height; ++y) {
    for (int x = 0; x < rest.width; ++x) {
      if (rest.At(x, y) == 0) {
        continue;
      }
      const std::vector<Eigen::Vector2i> region = TakeRegion(rest, x, y);
      const auto area = static_cast<double>(region.size());
      Eigen::Vector2d center = Eigen::Vector2d::Zero();
      for (const Eigen::Vector2i& at : region) {
        center += at.cast<double>() / area;
      }
      circles.push_back({center, std::sqrt(area / std::numbers::pi)});
    }
  }
  std::ranges::stable_sort(circles, std::greater<>(), &Circle::radius_px);
  const auto is_dust = [&](const Circle& circle) {
    return kDustShare * circle.radius_px * circle.radius_px <
           circles.front().radius_px * circles.front().radius_px;
  };
  const auto spheres = std::ranges::find_if(circles, is_dust) - circles.begin();
  if (spheres == 0 || (count != 0 && spheres != count)) {
    return Fail(ErrorCode::kBadData, "{}: {} regions; need {}, one a sphere", name, spheres,
                std::max(count, 1));
  }
  circles.resize(static_cast<size_t>(spheres));
  return circles;
}

Result<std::vector<Circle>> FindCircles(const Image<float>& gray, int count,
                                        std::string_view name) {
  if (count < 0) {
    return Fail(ErrorCode::kInvalidArgument, "count = {}; need 0 or more spheres", count);
  }
  const int step = std::max(1, std::max(gray.width, gray.height) / kSearchSizePx);
  const Image<float> small = Reduced(gray, step);
  const int side = std::min(small.width, small.height);
  if (side < kLeastSidePx) {
    return Fail(ErrorCode::kBadData, "{}: {} x {} px; too small or narrow to look for spheres in",
                name, gray.width, gray.height);
  }
  const int least = std::max(4, static_cast<int>(kLeastRadius * side));
  const int most = std::max(least, static_cast<int>(kMostRadius * side));
  const std::vector<GradientEdge> edges = GradientEdges(small);
  Image<float> votes = CenterVotes(edges, small.Size(), least, most);
  std::vector<SeenCircle> seen;
  seen.reserve(kCandidates);
  for (int candidate = 0; candidate < kCandidates; ++candidate) {
    const auto top = std::ranges::max_element(votes.pixels) - votes.pixels.begin();
    const auto x = static_cast<int>(top % small.width);
    const auto y = static_cast<int>(top / small.width);
    seen.push_back(BestRadius(edges, {x, y}, least, most));
    for (int j = std::max(0, y - 2); j <= std::min(small.height - 1, y + 2); ++j) {
      for (int i = std::max(0, x - 2); i <= std::min(small.width - 1, x + 2); ++i) {
        votes.At(i, j) = 0.0F;
      }
    }
  }
  std::ranges::stable_sort(seen, std::greater<>(), &SeenCircle::seen);
  std::vector<Circle> circles;
  circles.reserve(static_cast<size_t>(count));
  const auto wanted = static_cast<size_t>(count);
  const double least_seen =
      count == 0 ? std::max(kLeastSeen, kAlikeSeen * seen.front().seen) : kLeastSeen;
  const double least_radius = count == 0 ? kAlikeRadius * seen.front().circle.radius_px : 0.0;
  for (const SeenCircle& found : seen) {
    const bool taken = std::ranges::any_of(
        circles, [&](const Circle& circle) { return Overlap(circle, found.circle); });
    if (!taken && found.seen >= least_seen && found.circle.radius_px >= least_radius &&
        (count == 0 || circles.size() < wanted)) {
      circles.push_back(found.circle);
    }
  }
  if (circles.size() < std::max<size_t>(wanted, 1)) {
    return Fail(ErrorCode::kDegenerate,
                "{}: {} of {} spheres stand out (the best circle is seen to {:.0f} %); give a mask "
                "or their circles, or a photograph by room light",
                name, circles.size(), std::max(count, 1), 100.0 * seen.front().seen);
  }
  for (Circle& circle : circles) {
    circle.center_px = (circle.center_px.array() + 0.5) * step - 0.5;
    circle.radius_px *= step;
  }
  std::ranges::sort(circles, {}, [](const Circle& circle) { return circle.center_px.x(); });
  return circles;
}

}  // namespace sateen
