#include "simulation/virtual_rig/camera/scene_frame.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "core/check.h"
#include "simulation/random.h"
#include "simulation/virtual_rig/normal_quantiles.h"

namespace sateen {
namespace {

uint64_t SeedOf(const FrameState& state) {
  uint64_t seed = 0;
  const auto add = [&seed](double value) { seed = HashOf(seed, std::bit_cast<uint64_t>(value)); };
  for (const double share : state.shares) {
    add(share);
  }
  for (const double value : {state.ambient, state.exposure, state.shift_x_px, state.shift_y_px}) {
    add(value);
  }
  for (const PictureShade& shade : state.shades) {
    for (const double value : {shade.x_px, shade.y_px, shade.radius_px, shade.factor}) {
      add(value);
    }
  }
  return seed;
}

// Rows of (1).
class SumOfPictures {
 public:
  SumOfPictures(const LitScene& scene, const FrameState& state) {
    const auto add = [&](const Image<float>& picture, double share) {
      if (share * state.exposure != 0.0) {
        terms_.push_back({&picture, static_cast<float>(share * state.exposure)});
      }
    };
    add(scene.ambient, state.ambient);
    for (size_t k = 0; k < scene.lights.size(); ++k) {
      add(scene.lights[k], state.shares[k]);
    }
  }

  void Row(int y, std::span<float> row) const {
    std::ranges::fill(row, 0.0F);
    for (const Term& term : terms_) {
      const float* const v = &term.picture->At(0, y);
      const float weight = term.weight;
      for (size_t x = 0; x < row.size(); ++x) {
        row[x] += weight * v[x];
      }
    }
  }

 private:
  struct Term {
    const Image<float>* picture;
    float weight;
  };
  std::vector<Term> terms_;
};

// (2) along one axis: where in the lattice of every second site the shifted site i comes from.
class ShiftedAxis {
 public:
  ShiftedAxis(double shift_px, int count) : count_(count) {
    const double steps = std::floor(-0.5 * shift_px);
    // Further than the whole picture all is border.
    steps_ = static_cast<int>(std::clamp(steps, -1.0 * count, 1.0 * count));
    fraction_ = static_cast<float>(-0.5 * shift_px - steps);
  }
  [[nodiscard]] int Near(int i) const { return Clamped(i, i + 2 * steps_); }
  [[nodiscard]] int Far(int i) const { return Clamped(i, i + 2 * steps_ + 2); }
  [[nodiscard]] float Fraction() const { return fraction_; }

 private:
  // Returns a place within the picture and of the phase of i.
  [[nodiscard]] int Clamped(int i, int at) const {
    const int phase = i % 2;
    const int last = count_ - 1 - (count_ - 1 - phase) % 2;
    return std::clamp(at, phase, last);
  }
  int count_;
  int steps_ = 0;
  float fraction_ = 0.0F;
};

class ShiftedRows {
 public:
  ShiftedRows(const SumOfPictures& sum, const FrameState& state, ImageSize size)
      : sum_(sum),
        across_(state.shift_x_px, size.width),
        down_(state.shift_y_px, size.height),
        near_(static_cast<size_t>(size.width)),
        far_(near_.size()) {}

  void Row(int y, std::span<float> row) {
    sum_.Row(down_.Near(y), near_);
    sum_.Row(down_.Far(y), far_);
    for (size_t x = 0; x < near_.size(); ++x) {
      near_[x] += down_.Fraction() * (far_[x] - near_[x]);
    }
    for (int x = 0; x < static_cast<int>(row.size()); ++x) {
      const float from = near_[static_cast<size_t>(across_.Near(x))];
      const float to = near_[static_cast<size_t>(across_.Far(x))];
      row[static_cast<size_t>(x)] = from + across_.Fraction() * (to - from);
    }
  }

 private:
  const SumOfPictures& sum_;
  ShiftedAxis across_;
  ShiftedAxis down_;
  std::vector<float> near_;
  std::vector<float> far_;
};

void Darken(const PictureShade& shade, int y, std::span<float> row) {
  const double dy = y - shade.y_px;
  const auto factor = static_cast<float>(shade.factor);
  for (size_t x = 0; x < row.size(); ++x) {
    const double dx = static_cast<double>(x) - shade.x_px;
    if (dx * dx + dy * dy <= shade.radius_px * shade.radius_px) {
      row[x] *= factor;
    }
  }
}

// (3), in floats: they tell 65,536 readings apart 256 times over.
class SiteReader {
 public:
  explicit SiteReader(const Sensor& sensor)
      : sensor_(sensor),
        above_black_(static_cast<float>(sensor.black_dn + 0.5)),
        range_(static_cast<float>(sensor.white_dn - sensor.black_dn)),
        above_top_(static_cast<float>(sensor.saturation_dn.value_or(sensor.white_dn) + 0.5)) {
    if (sensor.full_well_electrons) {
      const double read = sensor.read_noise_electrons / *sensor.full_well_electrons;
      per_well_ = static_cast<float>(1.0 / *sensor.full_well_electrons);
      read_variance_ = static_cast<float>(read * read);
    }
  }

  void AddNoise(uint64_t seed, std::span<float> row) const {
    if (!sensor_.full_well_electrons) {
      return;
    }
    const NormalQuantiles& normal = NormalQuantiles::Table();
    const auto noisy = [&](float x, uint64_t random) {
      return x + std::sqrt(std::max(x, 0.0F) * per_well_ + read_variance_) * normal[random];
    };
    size_t x = 0;
    for (; x + 4 <= row.size(); x += 4) {
      const uint64_t random = MixBits(seed ^ x);
      row[x] = noisy(row[x], random);
      row[x + 1] = noisy(row[x + 1], random >> 16U);
      row[x + 2] = noisy(row[x + 2], random >> 32U);
      row[x + 3] = noisy(row[x + 3], random >> 48U);
    }
    for (; x < row.size(); ++x) {
      row[x] = noisy(row[x], MixBits(seed ^ x));
    }
  }

  void Read(std::span<float> row, uint16_t* dn) const {
    if (sensor_.compression != 0.0) {
      for (float& x : row) {
        x = static_cast<float>(sensor_.Compressed(static_cast<double>(x)));
      }
    }
    for (size_t x = 0; x < row.size(); ++x) {
      // Half a reading too much, of which the conversion takes the whole part.
      const float above = std::min(std::max(above_black_ + range_ * row[x], 0.5F), above_top_);
      dn[x] = static_cast<uint16_t>(static_cast<int>(above));
    }
  }

 private:
  const Sensor& sensor_;
  float above_black_;
  float range_;
  float above_top_;
  float per_well_ = 0.0F;
  float read_variance_ = 0.0F;
};

}  // namespace

Image<uint16_t> FrameOfScene(const LitScene& scene, const Sensor& sensor, const FrameState& state) {
  SATEEN_CHECK(state.shares.size() == scene.lights.size());
  const ImageSize size = scene.ambient.Size();
  const SumOfPictures sum(scene, state);
  ShiftedRows shifted(sum, state, size);
  const bool moved = state.shift_x_px != 0.0 || state.shift_y_px != 0.0;
  const SiteReader reader(sensor);
  const uint64_t seed = SeedOf(state);
  Image<uint16_t> mosaic(size);
  std::vector<float> row(static_cast<size_t>(size.width));
  for (int y = 0; y < size.height; ++y) {
    if (moved) {
      shifted.Row(y, row);
    } else {
      sum.Row(y, row);
    }
    for (const PictureShade& shade : state.shades) {
      Darken(shade, y, row);
    }
    reader.AddNoise(HashOf(seed, static_cast<uint64_t>(y)), row);
    reader.Read(row, &mosaic.At(0, y));
  }
  return mosaic;
}

}  // namespace sateen
