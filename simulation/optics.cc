#include "simulation/optics.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace sateen {
namespace {

constexpr int kOpticsRows = 16;
// Reach of the point spread; 6e-5 of it lies beyond.
constexpr double kReachInSigma = 4.0;

// Halves of a Gaussian that sums to 1, from its middle outwards.
std::vector<float> PointSpread(double sigma_px) {
  std::vector<double> half(static_cast<size_t>(std::ceil(kReachInSigma * sigma_px)) + 1);
  double sum = 0.0;
  for (size_t i = 0; i < half.size(); ++i) {
    const double d = static_cast<double>(i) / sigma_px;
    half[i] = std::exp(-0.5 * d * d);
    sum += i == 0 ? half[i] : 2.0 * half[i];
  }
  std::vector<float> result;
  result.reserve(half.size());
  for (const double weight : half) {
    result.push_back(static_cast<float>(weight / sum));
  }
  return result;
}

// Writes `source` convolved along x, or along y, into `target`.
Status Convolve(const std::vector<float>& half, bool along_x, const Image<float>& source,
                Image<float>& target, const Task& task) {
  const int reach = static_cast<int>(half.size()) - 1;
  return ParallelFor(source.height, kOpticsRows, task, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < source.width; ++x) {
        float sum = half[0] * source.At(x, y);
        for (int i = 1; i <= reach; ++i) {
          const float before =
              along_x ? source.At(std::max(x - i, 0), y) : source.At(x, std::max(y - i, 0));
          const float after = along_x ? source.At(std::min(x + i, source.width - 1), y)
                                      : source.At(x, std::min(y + i, source.height - 1));
          sum += half[static_cast<size_t>(i)] * (before + after);
        }
        target.At(x, y) = sum;
      }
    }
  });
}

Status Vignette(const std::array<double, 3>& vignetting, Image3& radiance, const Task& task) {
  const ImageSize size = radiance.Size();
  const double cx = 0.5 * (size.width - 1);
  const double cy = 0.5 * (size.height - 1);
  const double corner2 = std::max(cx * cx + cy * cy, 1.0);
  return ParallelFor(size.height, kOpticsRows, task, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const double r2 = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / corner2;
        const double gain = 1.0 + r2 * (vignetting[0] + r2 * (vignetting[1] + r2 * vignetting[2]));
        for (Image<float>& plane : radiance.planes) {
          plane.At(x, y) *= static_cast<float>(gain);
        }
      }
    }
  });
}

}  // namespace

Status ApplyOptics(const Lens& lens, Image3& radiance, const Task& task) {
  Status status;
  if (lens.vignetting != std::array<double, 3>{}) {
    status = Vignette(lens.vignetting, radiance, task);
  }
  if (lens.psf_sigma_px > 0.0) {
    const std::vector<float> half = PointSpread(lens.psf_sigma_px);
    Image<float> between(radiance.Size());
    for (Image<float>& plane : radiance.planes) {
      if (status) {
        status = Convolve(half, true, plane, between, task);
      }
      if (status) {
        status = Convolve(half, false, between, plane, task);
      }
    }
  }
  return status;
}

}  // namespace sateen
