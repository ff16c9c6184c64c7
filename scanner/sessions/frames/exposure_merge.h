#pragma once

#include <vector>

#include "imaging/image.h"
#include "imaging/raw.h"
#include "rig/rig.h"

namespace sateen {

/// Variance of a reading v above black, both as fractions of the way from black to white:
///
///     var(v) = per_reading v + floor = (g (white - black) v + r^2 + 1/12) / (white - black)^2
///
/// g and r are gain_dn_per_electron and read_noise_dn of the rig's response, 1/12 the rounding to
/// integers. Without them all noise is taken for that of the light, which needs no scale.
struct ReadingNoise {
  double per_reading = 1.0;
  double floor = 0.0;

  // Returns the weight of the radiance v / H where radiance is i: H^2 / var(i H), up to a factor
  // common to all H.
  [[nodiscard]] double Weight(double radiance, double exposure) const;
};

[[nodiscard]] ReadingNoise NoiseOf(const RawMosaic& mosaic, const Response* response);

/// Several exposures H_b of one plane as one of radiance:
///
///     i = sum_b w_b v_b / H_b / sum_b w_b,   w_b = H_b^2 / var(i_0 H_b)                      (1)
///
/// w_b is 0 where v_b is saturated.
///
/// i_0 is the radiance by the longest exposure that is not saturated, as the mean over the 5 x 5
/// samples of its kind around: one figure for all b, and hardly the noise of the reading itself. A
/// weight from that would prefer readings that noise has made small: of a few electrons, by 1 % of
/// their noise.
///
/// Exposures are added from the longest to the shortest.
/// Memory   three floats per sample, and three more while one is added, however many there are; the
///          same bits every time
/// Source   weights by inverse variance: Hasinoff, Durand, Freeman, "Noise-optimal capture for high
///          dynamic range photography", CVPR 2010; i_0 as the place of the variance is ours.
class ExposureMerge {
 public:
  // `stride` from a sample to the next one of its kind: 2 in a mosaic.
  ExposureMerge(ImageSize size, int stride)
      : stride_(stride), first_(size), mean_(size), weight_(size) {}

  // `readings` above black; `saturation`: the reading from which on they say nothing.
  void Add(const Image<float>& readings, double exposure, float saturation,
           const ReadingNoise& noise);
  // `saturated` where every exposure was.
  [[nodiscard]] Image<float> Radiance(float saturated) const;

 private:
  int stride_;
  Image<float> first_;   // i_0, where weight_ is above 0
  Image<float> mean_;    // i of (1), of what has been added so far
  Image<float> weight_;  // denominator of (1)
};

}  // namespace sateen
