#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"

namespace sateen {

/// A Bayer sensor, linear unless asked. Of radiance i at one site, with n a normal deviate:
///
///     e  = E s_c i / full_scale                            mean electrons                   (1)
///     e' = e + sqrt(max(e, 0) + r^2) n                     shot and read noise              (2)
///     DN = round(black + (white - black) f(e' / E)),       0 <= DN <= saturation            (3)
///     f(x) = x - c ((x - k) / (1 - k))^2  above the knee k, x below; straight on from x = 1 (4)
///
/// E = full_well_electrons, r = read_noise_electrons, s = sensitivity_rgb, c = compression. So
/// below the knee the variance of DN is g^2 (e + r^2) + 1/12, where g = (white - black) / E. The
/// shot noise is Gaussian, not Poisson: to 1 % from 30 electrons up.
struct Sensor {
  int bits = 16;              // 12, 14 or 16
  double black_dn = 0.0;      // 0 <= black < white
  double white_dn = 65535.0;  // the file's white; at most 2^bits - 1
  // Where it saturates; black < saturation <= white. Absent: at white.
  std::optional<double> saturation_dn = std::nullopt;
  std::array<uint8_t, 4> cfa = {0, 1, 1,
                                2};  // colour (0 red, 1 green, 2 blue) at (x, y) = 00 10 01 11
  double full_scale = 1.0;           // radiance that reads as white; > 0
  std::array<double, 3> sensitivity_rgb = {1.0, 1.0, 1.0};  // (0, 10] each
  double knee = 0.9;         // in (0, 1), of the way from black to white
  double compression = 0.0;  // 0 to (1 - knee) / 2: what f takes off at white
  // Absent: no noise of either kind.
  std::optional<double> full_well_electrons;  // > 0
  double read_noise_electrons = 0.0;          // >= 0

  // Returns f of (4).
  [[nodiscard]] double Compressed(double x) const;
  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Returns the sensor "nikon-d5100"; docs/simulation.md names the sources of its figures. Returns
// nothing for other names.
[[nodiscard]] std::optional<Sensor> SensorNamed(std::string_view name);

// Returns one of the four Bayer orders by its first two by two sites: "RGGB", "GRBG", "GBRG",
// "BGGR".
[[nodiscard]] std::optional<std::array<uint8_t, 4>> BayerNamed(std::string_view name);

// Returns the sensor's readings of linear radiance. Each site's noise depends on `seed` and its
// place alone.
[[nodiscard]] Result<Image<uint16_t>> Expose(const Sensor& sensor, const Image3& radiance,
                                             uint64_t seed, const Task& task = {});

}  // namespace sateen
