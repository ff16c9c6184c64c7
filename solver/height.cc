#include "solver/height.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <opencv2/core.hpp>
#include <span>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/parallel.h"
#include "rig/table_grid.h"

namespace sateen {
namespace {

constexpr int kRowsAtOnce = 16;
constexpr int kLargestFactor = 17;  // prime factor of a side; larger ones are slow to transform
constexpr int kMostSteps = 100;
constexpr double kTolerance = 1e-4;   // relative misfit, in the preconditioner's norm
constexpr double kLeastFacing = 0.1;  // n . v / |v|

bool IsGoodSide(int side) {
  for (int factor = 2; factor <= kLargestFactor; ++factor) {
    while (side % factor == 0) {
      side /= factor;
    }
  }
  return side == 1;
}

// Returns the next side that OpenCV's cosine transform, which needs an even one, is fast on.
int TransformSide(int side) {
  side += side % 2;
  while (!IsGoodSide(side)) {
    side += 2;
  }
  return side;
}

// Equations (4) of pairs of known neighbours, on a grid of sides that transform fast.
class Membrane {
 public:
  Membrane(ImageSize size, const Task& task)
      : known_(TransformSide(size.width), TransformSide(size.height)),
        task_(task),
        waves_x_(WavesOf(known_.width)),
        waves_y_(WavesOf(known_.height)) {}

  Image<uint8_t>& Known() { return known_; }
  [[nodiscard]] ImageSize Size() const { return known_.Size(); }

  // Solves A h = b by preconditioned conjugate gradients. `b` becomes the residual.
  Result<Image<float>> Solve(Image<float> b) {
    Image<float> h(Size());
    Image<float> direction(Size());
    Image<float> image(Size());  // A times the direction, then the preconditioned residual
    double before = 0.0;
    double first = 0.0;
    for (int step = 0; step < kMostSteps; ++step) {
      Precondition(b, image);
      const double now = Dot(b, image);
      first = step == 0 ? now : first;
      if (!(now > kTolerance * kTolerance * first)) {
        break;
      }
      const auto keep = static_cast<float>(step == 0 ? 0.0 : now / before);
      before = now;
      ForPixels(
          [&](size_t p) { direction.pixels[p] = image.pixels[p] + keep * direction.pixels[p]; });
      Apply(direction, image);
      const auto length = static_cast<float>(now / Dot(direction, image));
      ForPixels([&](size_t p) {
        h.pixels[p] += length * direction.pixels[p];
        b.pixels[p] -= length * image.pixels[p];
      });
      if (Status status = task_.CheckCancelled(); !status) {
        return tl::unexpected(status.error());
      }
    }
    return h;
  }

 private:
  // Returns the eigenvalues of the second difference along a side.
  static std::vector<float> WavesOf(int side) {
    std::vector<float> waves(static_cast<size_t>(side));
    for (size_t k = 0; k < waves.size(); ++k) {
      const double s = std::sin(0.5 * std::numbers::pi * static_cast<double>(k) / side);
      waves[k] = static_cast<float>(4.0 * s * s);
    }
    return waves;
  }

  template <typename Body>
  void ForRows(const Body& body) const {
    const Task unheeded{.threads = task_.threads};  // cancelling is checked per step
    const Status status =
        ParallelFor(known_.height, kRowsAtOnce, unheeded, [&](int begin, int end) {
          for (int row = begin; row < end; ++row) {
            body(row);
          }
        });
    SATEEN_CHECK(status.has_value());
  }

  template <typename Body>
  void ForPixels(const Body& body) const {
    ForRows([&](int row) {
      const size_t end = known_.Index(0, row + 1);
      for (size_t p = known_.Index(0, row); p < end; ++p) {
        body(p);
      }
    });
  }

  // Adds row by row, so that the bits do not depend on the threads.
  double Dot(const Image<float>& a, const Image<float>& b) const {
    std::vector<double> rows(static_cast<size_t>(known_.height));
    ForRows([&](int row) {
      const auto begin = static_cast<std::ptrdiff_t>(known_.Index(0, row));
      rows[static_cast<size_t>(row)] = std::transform_reduce(
          a.pixels.begin() + begin, a.pixels.begin() + begin + known_.width,
          b.pixels.begin() + begin, 0.0, std::plus<>(),
          [](float x, float y) { return static_cast<double>(x) * static_cast<double>(y); });
    });
    return std::accumulate(rows.begin(), rows.end(), 0.0);
  }

  // Computes A h: the sum of h's differences of a known pixel from its known neighbours.
  void Apply(const Image<float>& h, Image<float>& result) const {
    const auto width = static_cast<size_t>(known_.width);
    ForRows([&](int row) {
      for (int x = 0; x < known_.width; ++x) {
        const size_t p = known_.Index(x, row);
        float sum = 0.0F;
        const auto add = [&](bool is_inside, size_t other) {
          if (is_inside && known_.pixels[other] != 0) {
            sum += h.pixels[p] - h.pixels[other];
          }
        };
        if (known_.pixels[p] != 0) {
          add(x > 0, p - 1);
          add(x + 1 < known_.width, p + 1);
          add(row > 0, p - width);
          add(row + 1 < known_.height, p + width);
        }
        result.pixels[p] = sum;
      }
    });
  }

  // Solves the equations without gaps by cosine transform.
  void Precondition(const Image<float>& b, Image<float>& result) const {
    result.pixels = b.pixels;
    cv::Mat of_result(known_.height, known_.width, CV_32F, result.pixels.data());
    cv::dct(of_result, of_result);
    ForRows([&](int row) {
      float* const line = result.pixels.data() + known_.Index(0, row);
      const float wave_y = waves_y_[static_cast<size_t>(row)];
      for (size_t x = 0; x < waves_x_.size(); ++x) {
        line[x] = row == 0 && x == 0 ? 0.0F : line[x] / (waves_x_[x] + wave_y);
      }
    });
    cv::idct(of_result, of_result);
  }

  Image<uint8_t> known_;
  Task task_;
  std::vector<float> waves_x_;
  std::vector<float> waves_y_;
};

// Terms of (3) in one row. Pixels that are not known take no part in it.
struct SlopeRow {
  std::vector<float> x_mm, y_mm;  // x_0
  std::vector<float> s_x, s_y;
  std::vector<uint8_t> known;

  void Read(const NormalField& field, const TableGrid& grid, const Eigen::Vector3d& c, int row) {
    const auto width = static_cast<size_t>(field.reason.width);
    for (std::vector<float>* of_row : {&x_mm, &y_mm, &s_x, &s_y}) {
      of_row->resize(width);
    }
    known.resize(width);
    grid.Row(row, x_mm, y_mm);
    for (size_t x = 0; x < width; ++x) {
      const size_t p = field.reason.Index(0, row) + x;
      const Eigen::Vector3d n =
          Eigen::Vector3f(field.normal[0].pixels[p], field.normal[1].pixels[p],
                          field.normal[2].pixels[p])
              .cast<double>();
      const Eigen::Vector3d v((c.x() - static_cast<double>(x_mm[x])) / c.z(),
                              (c.y() - static_cast<double>(y_mm[x])) / c.z(), 1.0);
      const double facing = n.dot(v);
      const bool is_known = IsSolved(field, p) && facing > kLeastFacing * v.norm();
      known[x] = is_known ? 1 : 0;
      s_x[x] = is_known ? static_cast<float>(n.x() / facing) : 0.0F;  // (2)
      s_y[x] = is_known ? static_cast<float>(n.y() / facing) : 0.0F;
    }
  }

  // Returns h(y) - h(x) of (3). Pixel `at` of this row is x.
  [[nodiscard]] float Rise(size_t at, const SlopeRow& other, size_t other_at) const {
    return -0.5F * ((s_x[at] + other.s_x[other_at]) * (other.x_mm[other_at] - x_mm[at]) +
                    (s_y[at] + other.s_y[other_at]) * (other.y_mm[other_at] - y_mm[at]));
  }
};

// Returns the right-hand side of the normal equations of (4) and marks the known pixels.
Image<float> RisesOf(const NormalField& field, const TableGrid& grid, const Eigen::Vector3d& c,
                     Image<uint8_t>& known) {
  Image<float> b(known.Size());
  const auto add = [&](size_t from, size_t to, float rise) {
    b.pixels[from] -= rise;
    b.pixels[to] += rise;
  };
  SlopeRow above;
  SlopeRow row;
  for (int v = 0; v < field.reason.height; ++v) {
    std::swap(above, row);
    row.Read(field, grid, c, v);
    std::ranges::copy(row.known,
                      known.pixels.begin() + static_cast<std::ptrdiff_t>(known.Index(0, v)));
    for (size_t x = 0; x < row.known.size(); ++x) {
      const size_t p = known.Index(0, v) + x;
      if (x > 0 && row.known[x - 1] != 0 && row.known[x] != 0) {
        add(p - 1, p, row.Rise(x - 1, row, x));
      }
      if (v > 0 && above.known[x] != 0 && row.known[x] != 0) {
        add(p - static_cast<size_t>(known.width), p, above.Rise(x, row, x));
      }
    }
  }
  return b;
}

// Inverts (1), with the constant that makes the mean of z over the solved pixels 0.
Image<float> HeightOf(const Image<float>& h, const NormalField& field, double camera_z_mm) {
  Image<float> z(field.reason.Size());
  double sum = 0.0;
  double count = 0.0;
  const auto part = [&](int x, int y) {
    return std::exp(-static_cast<double>(h.At(x, y)) / camera_z_mm);
  };
  for (int y = 0; y < z.height; ++y) {
    for (int x = 0; x < z.width; ++x) {
      if (IsSolved(field, z.Index(x, y))) {
        sum += part(x, y);
        count += 1.0;
      }
    }
  }
  for (int y = 0; y < z.height; ++y) {
    for (int x = 0; x < z.width; ++x) {
      z.At(x, y) = static_cast<float>(camera_z_mm * (1.0 - part(x, y) * count / sum));
    }
  }
  return z;
}

}  // namespace

Result<Image<float>> IntegrateNormals(const NormalField& field, const Camera& camera,
                                      const Task& task) {
  const ImageSize size = field.reason.Size();
  if (size != camera.size_px) {
    return Fail(ErrorCode::kBadData, "the normals are {}x{} px but the camera has {}x{} px",
                size.width, size.height, camera.size_px.width, camera.size_px.height);
  }
  if (!camera.has_pose) {
    return Fail(
        ErrorCode::kBadData,
        "heights need the camera's position above the table, but it has no pose; run sateen "
        "calibrate pose");
  }
  const Result<TableGrid> grid = TableGrid::Make(camera);
  if (!grid) {
    return tl::unexpected(grid.error());
  }
  const Eigen::Vector3d c = camera.table_from_camera.translation();
  Membrane membrane(size, task);
  Image<float> b = RisesOf(field, *grid, c, membrane.Known());
  if (std::ranges::count(membrane.Known().pixels, uint8_t{1}) == 0) {
    return Fail(ErrorCode::kDegenerate,
                "no pixel has a normal that faces the camera; need some to compute heights");
  }
  return membrane.Solve(std::move(b)).map([&](const Image<float>& h) {
    return HeightOf(h, field, c.z());
  });
}

}  // namespace sateen
