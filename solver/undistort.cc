#include "solver/undistort.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/parallel.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr int kRowsPerPiece = 16;
constexpr double kOnPixel = 1e-9;  // smallest weight of a neighbour that counts

// Place between pixels: the pixel at or before it, and the fraction from there.
struct Place {
  int x;
  int y;
  double u;
  double v;

  // Returns the weight of the pixel (dx, dy) from it, 0 or 1 each.
  [[nodiscard]] double Weight(int dx, int dy) const {
    return (dx == 0 ? 1.0 - u : u) * (dy == 0 ? 1.0 - v : v);
  }
  [[nodiscard]] int NearestX() const { return u < 0.5 ? x : x + 1; }
  [[nodiscard]] int NearestY() const { return v < 0.5 ? y : y + 1; }
};

constexpr std::array<std::array<int, 2>, 4> kFour = {{{0, 0}, {1, 0}, {0, 1}, {1, 1}}};

std::optional<Place> PlaceOf(const Camera& camera, int column, int row) {
  const auto [width, height] = camera.size_px;
  const auto at = PixelOfPinholePixel(camera, column, row);
  if (!at || !(at->minCoeff() >= 0.0 && at->x() <= width - 1 && at->y() <= height - 1)) {
    return std::nullopt;
  }
  const int x = std::clamp(static_cast<int>(at->x()), 0, std::max(width - 2, 0));
  const int y = std::clamp(static_cast<int>(at->y()), 0, std::max(height - 2, 0));
  return Place{x, y, at->x() - x, at->y() - y};
}

double Linear(const Image<float>& plane, const Place& place) {
  double sum = 0.0;
  for (const auto& [dx, dy] : kFour) {
    const double weight = place.Weight(dx, dy);
    if (weight > kOnPixel) {
      sum += weight * static_cast<double>(plane.At(place.x + dx, place.y + dy));
    }
  }
  return sum;
}

// Returns the weights of the pixels at -1, 0, 1, 2 from the place.
std::array<double, 4> CubicWeights(double t) {
  return {t * (t * (1.0 - 0.5 * t) - 0.5), 1.0 + t * t * (1.5 * t - 2.5),
          t * (0.5 + t * (2.0 - 1.5 * t)), t * t * (0.5 * t - 0.5)};
}

double CubicAt(const Image<float>& plane, const Place& place) {
  const std::array<double, 4> across = CubicWeights(place.u);
  const std::array<double, 4> down = CubicWeights(place.v);
  double sum = 0.0;
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      sum += across[static_cast<size_t>(i)] * down[static_cast<size_t>(j)] *
             static_cast<double>(plane.At(place.x + i - 1, place.y + j - 1));
    }
  }
  return sum;
}

constexpr auto kSolvedCode = static_cast<uint8_t>(Reason::kSolved);

// Returns kSolved, or the reason of the heaviest neighbour that is not solved.
uint8_t ReasonAt(const Image<uint8_t>& reason, const Place& place) {
  uint8_t code = kSolvedCode;
  double heaviest = kOnPixel;
  for (const auto& [dx, dy] : kFour) {
    const double weight = place.Weight(dx, dy);
    const uint8_t here = weight > kOnPixel ? reason.At(place.x + dx, place.y + dy) : kSolvedCode;
    if (here != kSolvedCode && weight > heaviest) {
      heaviest = weight;
      code = here;
    }
  }
  return code;
}

bool AllSixteenSolved(const Image<uint8_t>& reason, const Place& place) {
  if (place.x < 1 || place.y < 1 || place.x + 2 >= reason.width || place.y + 2 >= reason.height) {
    return false;
  }
  for (int j = -1; j <= 2; ++j) {
    for (int i = -1; i <= 2; ++i) {
      if (reason.At(place.x + i, place.y + j) != kSolvedCode) {
        return false;
      }
    }
  }
  return true;
}

// Computes (1) for one pixel, which is unsolved and zero so far.
void Resample(const NormalField& field, const Place& place, int column, int row,
              NormalField& result) {
  const uint8_t code = ReasonAt(field.reason, place);
  result.reason.At(column, row) = code;
  result.samples.At(column, row) =
      field.samples.At(std::min(place.NearestX(), field.samples.width - 1),
                       std::min(place.NearestY(), field.samples.height - 1));
  if (code != kSolvedCode) {
    return;
  }
  const bool cubic = AllSixteenSolved(field.reason, place);
  const auto read = [&](const Image<float>& plane) {
    return cubic ? CubicAt(plane, place) : Linear(plane, place);
  };
  const Eigen::Vector3d normal =
      Eigen::Vector3d(read(field.normal[0]), read(field.normal[1]), read(field.normal[2]))
          .normalized();
  for (size_t c = 0; c < 3; ++c) {
    result.normal[c].At(column, row) = static_cast<float>(normal[static_cast<Eigen::Index>(c)]);
    result.albedo[c].At(column, row) = static_cast<float>(std::max(0.0, read(field.albedo[c])));
  }
  result.residual.At(column, row) = static_cast<float>(Linear(field.residual, place));
  if (!field.model.pixels.empty()) {
    result.uncertainty.At(column, row) = static_cast<float>(Linear(field.uncertainty, place));
    result.albedo_uncertainty.At(column, row) =
        static_cast<float>(Linear(field.albedo_uncertainty, place));
    result.model.At(column, row) =
        field.model.At(std::min(place.NearestX(), field.model.width - 1),
                       std::min(place.NearestY(), field.model.height - 1));
  }
}

Status CheckSize(ImageSize size, const Camera& camera) {
  if (size == camera.size_px) {
    return {};
  }
  return Fail(ErrorCode::kBadData,
              "maps of {} x {} px and a camera of {} x {} px; need the camera's size", size.width,
              size.height, camera.size_px.width, camera.size_px.height);
}

// Calls body(column, row, place) for every pixel that has a place.
template <typename Body>
Status ForEachPlace(const Camera& camera, const Task& task, const Body& body) {
  task.BeginStage("undistorting", camera.size_px.height);
  return ParallelFor(camera.size_px.height, kRowsPerPiece, task, [&](int begin, int end) {
    for (int row = begin; row < end; ++row) {
      for (int column = 0; column < camera.size_px.width; ++column) {
        if (const std::optional<Place> place = PlaceOf(camera, column, row)) {
          body(column, row, *place);
        }
      }
    }
  });
}

}  // namespace

Result<NormalField> Undistorted(const NormalField& field, const Camera& camera, const Task& task) {
  const ImageSize size = camera.size_px;
  NormalField result;
  result.summary = field.summary;
  result.Resize(size, !field.model.pixels.empty());  // outside the mask and zero everywhere
  const Status done = CheckSize(field.reason.Size(), camera).and_then([&] {
    return ForEachPlace(camera, task, [&](int column, int row, const Place& place) {
      Resample(field, place, column, row, result);
    });
  });
  if (!done) {
    return tl::unexpected(done.error());
  }
  return result;
}

Result<Image<float>> Undistorted(const Image<float>& plane, const Camera& camera,
                                 const Task& task) {
  Image<float> result(camera.size_px);
  const Status done = CheckSize(plane.Size(), camera).and_then([&] {
    return ForEachPlace(camera, task, [&](int column, int row, const Place& place) {
      result.At(column, row) = static_cast<float>(Linear(plane, place));
    });
  });
  if (!done) {
    return tl::unexpected(done.error());
  }
  return result;
}

}  // namespace sateen
