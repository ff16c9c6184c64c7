#include "scanner/sessions/frames/exposure_merge.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <limits>

#include "simulation/random.h"
#include "simulation/sensor.h"

namespace sateen::exposure_merge_test {
namespace {

constexpr std::array kExposures = {16.0, 4.0, 1.0};
constexpr float kSaturation = 1.0F;
constexpr int kSide = 400;

// One noisy reading of radiance at every site, as a fraction of the range.
Image<float> ReadingsOf(const Sensor& sensor, double radiance, double exposure, uint64_t seed) {
  const Image3 shown({kSide, kSide}, static_cast<float>(radiance * exposure));
  const Image<uint16_t> dn = *Expose(sensor, shown, seed, {.threads = 1});
  Image<float> readings(dn.Size());
  for (size_t p = 0; p < dn.pixels.size(); ++p) {
    readings.pixels[p] =
        static_cast<float>((dn.pixels[p] - sensor.black_dn) / (sensor.white_dn - sensor.black_dn));
  }
  return readings;
}

struct Moments {
  double mean = 0.0;
  double sd = 0.0;
};

Moments MomentsOf(const Image<float>& image) {
  double sum = 0.0;
  double sum2 = 0.0;
  for (const float value : image.pixels) {
    sum += static_cast<double>(value);
    sum2 += static_cast<double>(value) * static_cast<double>(value);
  }
  const auto n = static_cast<double>(image.pixels.size());
  return {sum / n, std::sqrt(sum2 / n - sum / n * sum / n)};
}

Sensor NoisySensor() {
  return {.bits = 14,
          .black_dn = 600.0,
          .white_dn = 15600.0,
          .full_well_electrons = 15000.0,
          .read_noise_electrons = 6.0};
}

ReadingNoise NoiseOfSensor(const Sensor& sensor) {
  RawMosaic mosaic;
  mosaic.black = static_cast<float>(sensor.black_dn);
  mosaic.white = static_cast<float>(sensor.white_dn);
  Response response;
  const double range = sensor.white_dn - sensor.black_dn;
  response.gain_dn_per_electron = range / *sensor.full_well_electrons;
  response.read_noise_dn = *response.gain_dn_per_electron * sensor.read_noise_electrons;
  return NoiseOf(mosaic, &response);
}

// From a handful of electrons in the longest exposure to where only the shortest one is left.
TEST(ExposureMerge, IsUnbiasedAndAsGoodAsCanBe) {
  const Sensor sensor = NoisySensor();
  const ReadingNoise noise = NoiseOfSensor(sensor);
  uint64_t seed = 1;
  for (const double radiance : {3e-5, 3e-4, 3e-3, 0.03, 0.05, 0.2, 0.5, 0.9}) {
    ExposureMerge merge({kSide, kSide}, 2);
    double information = 0.0;  // sum of H^2 / var: the bound of Cramer and Rao is its inverse
    for (const double exposure : kExposures) {
      merge.Add(ReadingsOf(sensor, radiance, exposure, seed++), exposure, kSaturation, noise);
      if (radiance * exposure < 1.0) {
        const double variance = noise.per_reading * radiance * exposure + noise.floor;
        information += exposure * exposure / variance;
      }
    }
    const Moments found = MomentsOf(merge.Radiance(std::numeric_limits<float>::infinity()));
    const double bound = 1.0 / std::sqrt(information);
    fmt::print("radiance {:7.5f}: mean off by {:+.2f} standard errors, sd {:.3f} of the bound\n",
               radiance, (found.mean - radiance) / (bound / kSide), found.sd / bound);
    EXPECT_NEAR(found.mean, radiance, 3.0 * bound / kSide) << radiance;
    EXPECT_NEAR(found.sd / bound, 1.0, 0.05) << radiance;
  }
}

TEST(ExposureMerge, WeighsByExposureWhereTheNoiseIsNotKnown) {
  ExposureMerge merge({1, 1}, 1);
  merge.Add(Image<float>(1, 1, 0.4F), 4.0, kSaturation, {});
  merge.Add(Image<float>(1, 1, 0.2F), 1.0, kSaturation, {});
  EXPECT_FLOAT_EQ(merge.Radiance(9.0F).At(0, 0), (4.0F * 0.1F + 1.0F * 0.2F) / 5.0F);
}

TEST(ExposureMerge, LeavesOutWhatIsSaturatedAndSaysWhereAllAre) {
  ExposureMerge merge({3, 1}, 1);
  Image<float> longest(3, 1, 1.0F);
  longest.At(2, 0) = 0.4F;
  Image<float> shortest(3, 1, 0.5F);
  shortest.At(1, 0) = 1.0F;
  shortest.At(2, 0) = 0.1F;
  merge.Add(longest, 4.0, kSaturation, {});
  merge.Add(shortest, 1.0, kSaturation, {});
  EXPECT_THAT(merge.Radiance(9.0F).pixels, ::testing::ElementsAre(0.5F, 9.0F, 0.1F));
}

TEST(ExposureMerge, OneExposureStaysAsItIs) {
  ExposureMerge merge({1, 1}, 1);
  merge.Add(Image<float>(1, 1, 0.3F), 0.7, kSaturation, NoiseOfSensor(NoisySensor()));
  EXPECT_EQ(merge.Radiance(9.0F).At(0, 0), 0.3F * static_cast<float>(1.0 / 0.7));
}

TEST(ReadingNoise, IsThatOfTheResponse) {
  const ReadingNoise noise = NoiseOfSensor(NoisySensor());
  EXPECT_NEAR(noise.per_reading, 1.0 / 15000.0, 1e-12);
  EXPECT_NEAR(noise.floor, (36.0 + 1.0 / 12.0) / (15000.0 * 15000.0), 1e-15);
  // 2 of radiance for 4: v = 8 per exposure, H^2 = 16.
  EXPECT_NEAR(noise.Weight(2.0, 4.0), 16.0 / (8.0 * noise.per_reading + noise.floor), 1e-6);
}

}  // namespace
}  // namespace sateen::exposure_merge_test
