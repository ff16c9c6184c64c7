#pragma once

#include <array>
#include <vector>

#include "calibration/response/chart_readings.h"
#include "core/error.h"

namespace sateen {

// The noise of one patch and colour in a pair of equal frames.
struct TransferPoint {
  double mean_dn = 0.0;       // above the dark
  double variance_dn2 = 0.0;  // of one frame: half of that of the difference
  double count = 0.0;         // sites
  size_t colour = 0;
  bool is_dark = false;
};

struct PhotonTransfer {
  double gain_dn_per_electron = 0.0;
  double gain_sd = 0.0;
  std::array<double, 3> gain_rgb = {};  // each colour alone
  std::array<double, 3> gain_rgb_sd = {};
  double read_noise_dn = 0.0;  // without what rounding to whole readings adds
  double read_noise_sd = 0.0;
  double misfit = 0.0;  // root mean square of the points off the line, in standard deviations
  std::vector<TransferPoint> points;
};

/// The noise of pairs of frames of one light and one exposure, lit and dark; patches of lit frames
/// only where all sites are below `highest_dn`. A difference has no shading, no dust and no fixed
/// pattern in it.
[[nodiscard]] std::vector<TransferPoint> TransferPoints(const ChartReadings& readings,
                                                        const std::vector<PatchSample>& samples,
                                                        double highest_dn);

/// Gain and read noise by photon transfer, the least squares of
///
///     variance - 1/12 = g mean + sigma^2                                                    (1)
///
/// with weights (n - 1) / (2 variance^2) from (1) itself, so that they do not follow the noise of the
/// variances. 1/12 is what rounding adds. Dark points fix sigma where `use_dark`.
///
/// Errors   kDegenerate: fewer than three lit points; no noise in them
/// Source   Janesick, "Photon Transfer", SPIE Press, 2007, chapter 5
[[nodiscard]] Result<PhotonTransfer> FitPhotonTransfer(std::vector<TransferPoint> points,
                                                       bool use_dark);

}  // namespace sateen
