#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"

namespace sateen {

/// A linear Bayer sensor. Of radiance i at one site, with n a normal deviate:
///
///     e  = E i / full_scale                                mean electrons                   (1)
///     e' = e + sqrt(max(e, 0) + r^2) n                     shot and read noise              (2)
///     DN = round(black + (white - black) e' / E),          0 <= DN <= white                 (3)
///
/// E = full_well_electrons, r = read_noise_electrons. So the variance of DN is g^2 (e + r^2) + 1/12,
/// g = (white - black) / E. The shot noise is Gaussian, not Poisson: to 1 % from 30 electrons up.
struct Sensor {
  int bits = 16;              // 12, 14 or 16
  double black_dn = 0.0;      // 0 <= black < white
  double white_dn = 65535.0;  // where it saturates; at most 2^bits - 1
  std::array<uint8_t, 4> cfa = {0, 1, 1,
                                2};  // colour (0 red, 1 green, 2 blue) at (x, y) = 00 10 01 11
  double full_scale = 1.0;           // radiance that reads as white; > 0
  // Absent: no noise of either kind.
  std::optional<double> full_well_electrons;  // > 0
  double read_noise_electrons = 0.0;          // >= 0

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// "nikon-d5100"; docs/simulation.md names the sources of its figures. Nothing for other names.
[[nodiscard]] std::optional<Sensor> SensorNamed(std::string_view name);

// The four Bayer orders by their first two by two sites: "RGGB", "GRBG", "GBRG", "BGGR".
[[nodiscard]] std::optional<std::array<uint8_t, 4>> BayerNamed(std::string_view name);

// What the sensor reads of linear radiance. Each site's noise depends on `seed` and its place alone.
[[nodiscard]] Result<Image<uint16_t>> Expose(const Sensor& sensor, const Image3& radiance,
                                             uint64_t seed, const Task& task = {});

}  // namespace sateen
