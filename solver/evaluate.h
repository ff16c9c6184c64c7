#pragma once

#include <array>
#include <cstdint>

#include "core/error.h"
#include "imaging/image.h"
#include "solver/normal_field.h"

namespace sateen {

struct ErrorStatistics {
  int64_t count = 0;  // values compared; the other fields are 0 where there are none
  double mean = 0.0;
  double median = 0.0;
  double p99 = 0.0;
  double max = 0.0;
};

/// Compares solved and true normals by their angle, in degrees, over the pixels that are solved and
/// whose truth is known (not zero):
///
///     angle = atan2(|n x t|, n . t)                  exact for small angles, unlike acos(n . t)
///
/// `map`, where not null, receives the angle of each compared pixel and 0 elsewhere. Fails with
/// kBadData where the sizes differ.
[[nodiscard]] Result<ErrorStatistics> AngularErrorDeg(const NormalField& field,
                                                      const Image3& true_normal,
                                                      Image<float>* map = nullptr);

/// Compares normals below 1 cycle per 50 mm: the slow slope that a wrong light leaves towards the
/// edges, without errors of weave and noise. Over the pixels of AngularErrorDeg() whose normals are
/// both within 80 degrees of the view, with slopes s = -(n_x, n_y) / n_z:
///
///     d = G * (s_solved - s_true),   angle = atan(|d|)                                        (1)
///
/// G is a Gaussian of standard deviation 6.62 mm on the table, normalised over those pixels, which
/// passes exp(-2 pi^2 6.62^2 f^2) of a wave of f cycles per mm: half of its power at 1 / (50 mm).
///
/// pitch_mm  distance from pixel to pixel on the table, > 0
/// Returns   over the middles of squares of at most an eighth of that deviation, where a fifth of G
///           lies on compared pixels (a corner has a quarter); count 0 where there is none
/// Errors    kBadData where the sizes differ
/// Cost      O(pixels)
[[nodiscard]] Result<ErrorStatistics> LowFrequencyErrorDeg(const NormalField& field,
                                                           const Image3& true_normal,
                                                           double pitch_mm);

/// Returns the relative error of each pixel's albedo, which NormalField::albedo_uncertainty
/// predicts:
///
///     |y - t| / t,   y, t: luminances of solved and true albedo
///
/// For a mosaic, y and t are of the site's own colour, because the other colours are its
/// neighbours'. `cfa` then holds the colours in rows 0 and 1, columns 0 and 1. 0 where unsolved or
/// t is not above 0. Fails with kBadData where the sizes differ.
[[nodiscard]] Result<Image<float>> AlbedoErrorMap(const NormalField& field,
                                                  const Image3& true_albedo,
                                                  const std::array<uint8_t, 4>* cfa = nullptr);

// Compares albedos by |rho - t| / t, over the channels whose true albedo t is above 0.
[[nodiscard]] Result<ErrorStatistics> RelativeAlbedoError(const NormalField& field,
                                                          const Image3& true_albedo);

}  // namespace sateen
