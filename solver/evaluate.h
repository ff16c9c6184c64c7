#pragma once

#include <cstdint>

#include "core/error.h"
#include "imaging/image.h"
#include "solver/lambertian.h"

namespace sateen {

struct ErrorStatistics {
  int64_t count = 0;  // values compared; the other figures are 0 when none is
  double mean = 0.0;
  double median = 0.0;
  double p99 = 0.0;
  double max = 0.0;
};

/// Angle between solved and true normal, in degrees, over the pixels that are solved and whose
/// truth is known (not zero):
///
///     angle = atan2(|n x t|, n . t)                  exact for small angles, unlike acos(n . t)
///
/// `map`, where not null, receives the angle of each compared pixel and 0 elsewhere. kBadData when
/// the sizes differ.
[[nodiscard]] Result<ErrorStatistics> AngularErrorDeg(const NormalField& field,
                                                      const Image3& true_normal,
                                                      Image<float>* map = nullptr);

// |rho - t| / t over the channels of those pixels whose true albedo t is above 0.
[[nodiscard]] Result<ErrorStatistics> RelativeAlbedoError(const NormalField& field,
                                                          const Image3& true_albedo);

}  // namespace sateen
