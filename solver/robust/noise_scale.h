#pragma once

#include "solver/least_squares/least_squares.h"

namespace sateen {

struct NoiseScale {
  double scale_squared = 1.0;  // s^2; infinite where nothing shows the noise
  MisfitSample sample;         // misfits that it was measured on
};

/// Measures the scale s of the noise on some 4,000 pixels inside the mask.
///
///     s^2 = q(misfits) / q(chi^2 / (usable - 3))                                              (1)
///
/// over the pixels with the most frequent number of usable samples. q is the 25 % quantile where
/// the noise is known, otherwise the 5 % quantile: on a shiny scene most misfits show the shine.
///
/// Known noise bounds s^2 by 1 and 0.1, because demosaicing only reduces noise. Unknown noise
/// bounds it by the differences of neighbouring pixels, because a shiny scene misfits everywhere.
/// s^2 is never below the variance that rounding leaves, which may be all there is in smooth
/// frames. Where the noise is unknown and no pixel has more than three samples, the differences of
/// neighbours alone give s^2. Where these show nothing either, it is infinite: normals are 180
/// degrees uncertain, and albedos by their own size.
///
/// The pixels lie at equal distances in their own order, so they depend neither on the threads nor
/// on how much of the image the mask leaves out.
[[nodiscard]] NoiseScale FindNoiseScale(const FramesInput& input, const LeastSquaresRows& rows,
                                        bool known);

}  // namespace sateen
