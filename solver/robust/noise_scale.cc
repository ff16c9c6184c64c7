#include "solver/robust/noise_scale.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "core/statistics.h"
#include "solver/noise.h"

namespace sateen {
namespace {

// Quantiles of the misfits.
constexpr double kShareOfKnown = 0.25;
constexpr double kShareOfUnknown = 0.05;
// Smallest share of the variance that demosaicing leaves: a quarter where four sites are averaged,
// and the luminance averages three colours that share sites.
constexpr double kLeastScaleSquared = 0.1;
constexpr double kQuarterOfOneFreedom = 0.1015;  // quantile of chi^2
// Pixels that are sampled, in runs because neighbours are compared; more where fewer than
// kFewestMisfits of them are solved.
constexpr int64_t kMisfitsLookedAt = 1 << 12;
constexpr int64_t kFewestMisfits = 1 << 11;
constexpr int64_t kRun = 64;
constexpr size_t kNeighbourStep = 3;  // differences then share no sample
constexpr size_t kDifferencesLookedAt = 1 << 12;
constexpr double kGoldenRatio = 0.6180339887498949;
// Variance of a second difference of rounded samples, 6/12 of a step squared.
constexpr double kRoundingOfStep = 6.0 / 12.0;
// Share of the second differences that do not vanish and are at most single steps.
constexpr double kShareOfSteps = 0.05;
// Fractions of the first differences and of the samples below which second differences vanish:
// steps of equal size, also of 8-bit sRGB files, and rounding to float.
constexpr float kLeastBend = 0.02F;
constexpr float kFloatBend = 4.0F * std::numeric_limits<float>::epsilon();
constexpr auto kFloatStep = static_cast<double>(std::numeric_limits<float>::epsilon());
constexpr double kNotKnown = std::numeric_limits<double>::infinity();

// Pixels inside the mask, in their own order.
class InsidePixels {
 public:
  InsidePixels(ImageSize size, const Mask* mask) : mask_(mask) {
    before_.push_back(0);
    for (int row = 0; row < size.height; ++row) {
      int64_t inside = size.width;
      if (mask != nullptr) {
        const auto begin = mask->pixels.begin() + static_cast<std::ptrdiff_t>(mask->Index(0, row));
        inside = size.width - std::count(begin, begin + size.width, uint8_t{0});
      }
      before_.push_back(before_.back() + inside);
    }
    width_ = static_cast<size_t>(size.width);
  }
  [[nodiscard]] int64_t Count() const { return before_.back(); }

  // Appends those of order [begin, end).
  void Append(int64_t begin, int64_t end, std::vector<size_t>& pixels) const {
    while (begin < end) {
      const auto after = std::upper_bound(before_.begin(), before_.end(), begin);
      const auto row = static_cast<size_t>(after - before_.begin()) - 1;
      int64_t order = before_[row];
      for (size_t p = row * width_; p < (row + 1) * width_ && begin < end; ++p) {
        if (mask_ != nullptr && mask_->pixels[p] == 0) {
          continue;
        }
        if (order == begin) {
          pixels.push_back(p);
          ++begin;
        }
        ++order;
      }
    }
  }

 private:
  const Mask* mask_;
  size_t width_ = 0;
  std::vector<int64_t> before_;  // pixels in the rows above
};

// Returns `count` pixels in runs, or all where there are not many more. Each run lies in one of as
// many equal stretches, at varying places so that the runs do not meet a pattern of the cloth.
std::vector<size_t> PixelsLookedAt(const InsidePixels& inside, int64_t count) {
  std::vector<size_t> pixels;
  if (inside.Count() <= 2 * count) {
    inside.Append(0, inside.Count(), pixels);
    return pixels;
  }
  const int64_t runs = count / kRun;
  for (int64_t j = 0; j < runs; ++j) {
    const int64_t begin = j * inside.Count() / runs;
    const int64_t room = (j + 1) * inside.Count() / runs - begin - kRun;
    const double share = std::fmod(static_cast<double>(j) * kGoldenRatio, 1.0);
    const int64_t first = begin + static_cast<int64_t>(share * static_cast<double>(room));
    inside.Append(first, first + kRun, pixels);
  }
  return pixels;
}

MisfitSample SampleMisfits(const FramesInput& input, const LeastSquaresRows& rows) {
  const InsidePixels inside(input.stack[0].rgb.Size(), input.mask);
  MisfitSample sample;
  for (int64_t count = kMisfitsLookedAt;; count *= 8) {
    sample.pixels = PixelsLookedAt(inside, count);
    rows.FindMisfits(sample);
    const int64_t unsolved = std::ranges::count(sample.samples, uint8_t{0});
    const auto looked_at = static_cast<int64_t>(sample.pixels.size());
    if (looked_at - unsolved >= kFewestMisfits || looked_at == inside.Count()) {
      return sample;
    }
  }
}

// Returns the most frequent number of usable samples that leaves a residual; 0: none does.
int UsualSamples(const MisfitSample& sample) {
  std::array<int64_t, 256> counts = {};
  for (const uint8_t samples : sample.samples) {
    ++counts[samples];
  }
  const auto most = std::max_element(counts.begin() + 4, counts.end());
  return *most > 0 ? static_cast<int>(most - counts.begin()) : 0;
}

// Noise as neighbouring samples show it.
struct Neighbours {
  double scale_squared = kNotKnown;  // infinite where they show nothing
  double floor = 0.0;                // of s^2: the variance of rounding, also in exact frames
};

// Measures s^2 of unknown noise, var = s^2 i, from second differences of green samples along the
// rows, whose variance is 6 var. Changes of the surface from pixel to pixel make it too large,
// errors of the model do not. Differences that vanish come from rounding to few bits. Where they
// are many, s^2 is the mean, and at least the variance of rounding.
Neighbours LookAtNeighbours(const LightStack& stack, const MisfitSample& sample) {
  std::vector<float> squares;
  squares.reserve(stack.size() * sample.pixels.size() / kNeighbourStep + stack.size());
  double sum_of_squares = 0.0;
  double sum_of_means = 0.0;
  size_t count = 0;
  const auto width = static_cast<size_t>(stack[0].rgb[0].width);
  // Takes some of the lights at each pixel, in turn, where there are many differences.
  const size_t all_differences = stack.size() * (sample.pixels.size() / kNeighbourStep);
  const size_t light_step =
      std::clamp<size_t>(all_differences / kDifferencesLookedAt, 1, stack.size());
  for (size_t j = 1; j + 1 < sample.pixels.size(); j += kNeighbourStep) {
    const size_t p = sample.pixels[j];
    const bool inside = p % width > 0 && p % width + 1 < width && sample.pixels[j - 1] + 1 == p &&
                        sample.pixels[j + 1] == p + 1 && sample.samples[j - 1] > 0 &&
                        sample.samples[j] > 0 && sample.samples[j + 1] > 0;
    for (size_t k = j / kNeighbourStep % light_step; inside && k < stack.size(); k += light_step) {
      const float* i = stack[k].rgb[1].pixels.data() + p;
      const float bend = i[-1] - 2.0F * i[0] + i[1];
      const float mean = (i[-1] + i[0] + i[1]) / 3.0F;
      if (!(mean > 0.0F && std::isfinite(bend) && i[0] < stack[k].full_scale)) {
        continue;
      }
      ++count;
      sum_of_means += static_cast<double>(mean);
      if (std::abs(bend) > std::max(kLeastBend * std::abs(i[1] - i[-1]), kFloatBend * mean)) {
        squares.push_back(bend * bend / (6.0F * mean));
        sum_of_squares += static_cast<double>(squares.back());
      }
    }
  }
  if (squares.empty()) {
    return {};
  }
  const auto all = static_cast<double>(count);
  const double of_float = kFloatStep * kFloatStep / 12.0 * sum_of_means / all;
  const auto quarter = static_cast<double>(Quantile(squares, 0.25));
  if (4 * squares.size() >= 3 * count) {
    return {.scale_squared = quarter / kQuarterOfOneFreedom, .floor = of_float};
  }
  const auto least = static_cast<double>(Quantile(std::move(squares), kShareOfSteps));
  return {.scale_squared = std::max(sum_of_squares / all, kRoundingOfStep * quarter),
          .floor = std::max(of_float, kRoundingOfStep * least)};
}

double ScaleSquaredOf(const LightStack& stack, const MisfitSample& sample, bool known) {
  const int usual = UsualSamples(sample);
  double scale = kNotKnown;
  if (usual > 0) {
    std::vector<float> misfits;
    for (size_t j = 0; j < sample.pixels.size(); ++j) {
      if (sample.samples[j] == usual) {
        misfits.push_back(sample.misfits[j]);
      }
    }
    const double share = known ? kShareOfKnown : kShareOfUnknown;
    scale = static_cast<double>(Quantile(std::move(misfits), share)) /
            ReducedChiSquaredQuantile(share, usual - 3);
  }
  if (known) {
    return std::clamp(scale, kLeastScaleSquared, 1.0);
  }
  const Neighbours neighbours = LookAtNeighbours(stack, sample);
  scale = std::max(std::min(scale, neighbours.scale_squared), neighbours.floor);
  if (scale > 0.0) {
    return scale;
  }
  return kNotKnown;
}

}  // namespace

NoiseScale FindNoiseScale(const FramesInput& input, const LeastSquaresRows& rows, bool known) {
  NoiseScale scale;
  scale.sample = SampleMisfits(input, rows);
  scale.scale_squared = ScaleSquaredOf(input.stack, scale.sample, known);
  return scale;
}

}  // namespace sateen
