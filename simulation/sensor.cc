#include "simulation/sensor.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "simulation/random.h"

namespace sateen {
namespace {

constexpr int kSensorRows = 16;

}  // namespace

double Sensor::Compressed(double x) const {
  if (x <= knee) {
    return x;
  }
  const double over = (std::min(x, 1.0) - knee) / (1.0 - knee);
  const double beyond = std::max(x - 1.0, 0.0) / (1.0 - knee);
  return x - compression * (over * over + 2.0 * beyond);  // (4)
}

Status Sensor::Validate() const {
  const auto fail = [](std::string_view field, double value, std::string_view range) {
    return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", field, value, range);
  };
  if (bits != 12 && bits != 14 && bits != 16) {
    return fail("bits", bits, "12, 14 or 16");
  }
  const double top = std::exp2(bits) - 1.0;
  if (!(white_dn > 0.0 && white_dn <= top && white_dn == std::floor(white_dn))) {
    return fail("white", white_dn, fmt::format("a whole number from 1 to {:g}", top));
  }
  if (!(black_dn >= 0.0 && black_dn < white_dn && black_dn == std::floor(black_dn))) {
    return fail("black", black_dn, fmt::format("a whole number from 0 to below {:g}", white_dn));
  }
  if (saturation_dn && !(*saturation_dn > black_dn && *saturation_dn <= white_dn &&
                         *saturation_dn == std::floor(*saturation_dn))) {
    return fail("saturation", *saturation_dn,
                fmt::format("a whole number above {:g} and up to {:g}", black_dn, white_dn));
  }
  for (const double sensitivity : sensitivity_rgb) {
    if (!(sensitivity > 0.0 && sensitivity <= 10.0)) {
      return fail("sensitivity_rgb", sensitivity, "above 0 and up to 10 each");
    }
  }
  if (!(knee > 0.0 && knee < 1.0)) {
    return fail("knee", knee, "above 0 and below 1");
  }
  if (!(compression >= 0.0 && compression <= 0.5 * (1.0 - knee))) {
    return fail("compression", compression,
                fmt::format("0 to {:g}, half of 1 - knee", 0.5 * (1.0 - knee)));
  }
  if (!(full_scale >= 1e-6 && full_scale <= 1e6)) {
    return fail("full_scale", full_scale, "1e-6 to 1e6");
  }
  if (full_well_electrons && !(*full_well_electrons >= 1.0 && *full_well_electrons <= 1e9)) {
    return fail("full_well_electrons", *full_well_electrons, "1 to 1e9");
  }
  if (!(read_noise_electrons >= 0.0 && read_noise_electrons <= 1e6)) {
    return fail("read_noise_electrons", read_noise_electrons, "0 to 1e6");
  }
  if (read_noise_electrons > 0.0 && !full_well_electrons) {
    return fail("read_noise_electrons", read_noise_electrons,
                "full_well_electrons beside it: without that there is no noise");
  }
  return {};
}

std::optional<Sensor> SensorNamed(std::string_view name) {
  if (name == "nikon-d5100") {
    return Sensor{.bits = 14,
                  .black_dn = 0.0,
                  .white_dn = 15892.0,
                  .full_well_electrons = 47000.0,
                  .read_noise_electrons = 4.9};
  }
  return std::nullopt;
}

std::optional<std::array<uint8_t, 4>> BayerNamed(std::string_view name) {
  constexpr std::string_view kColours = "RGB";
  for (const std::string_view known : {"RGGB", "GRBG", "GBRG", "BGGR"}) {
    if (name == known) {
      std::array<uint8_t, 4> cfa = {};
      std::ranges::transform(known, cfa.begin(), [&](char colour) {
        return static_cast<uint8_t>(kColours.find(colour));
      });
      return cfa;
    }
  }
  return std::nullopt;
}

Result<Image<uint16_t>> Expose(const Sensor& sensor, const Image3& radiance, uint64_t seed,
                               const Task& task) {
  if (Status status = sensor.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  const ImageSize size = radiance.Size();
  const double range_dn = sensor.white_dn - sensor.black_dn;
  const double top_dn = sensor.saturation_dn.value_or(sensor.white_dn);
  const double full_well = sensor.full_well_electrons.value_or(1.0);
  const double read_variance = sensor.read_noise_electrons * sensor.read_noise_electrons;
  Image<uint16_t> mosaic(size);
  const Status status = ParallelFor(size.height, kSensorRows, task, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const uint8_t colour = sensor.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)];
        const size_t site = mosaic.Index(x, y);
        const auto i = static_cast<double>(radiance[colour].pixels[site]);
        double e = full_well * sensor.sensitivity_rgb[colour] * i / sensor.full_scale;  // (1)
        if (sensor.full_well_electrons) {
          e += std::sqrt(std::max(e, 0.0) + read_variance) * NormalDeviate(seed, site);  // (2)
        }
        const double dn =
            std::round(sensor.black_dn + range_dn * sensor.Compressed(e / full_well));  // (3)
        mosaic.pixels[site] = static_cast<uint16_t>(std::clamp(dn, 0.0, top_dn));
      }
    }
  });
  if (!status) {
    return tl::unexpected(status.error());
  }
  return mosaic;
}

}  // namespace sateen
