#pragma once

#include <array>
#include <vector>

#include "calibration/response/chart_readings.h"
#include "core/error.h"

namespace sateen {

// Noise of one patch and colour in a pair of equal frames.
struct TransferPoint {
  double mean_dn = 0.0;       // above the dark
  double variance_dn2 = 0.0;  // variance of one frame: half of that of the difference
  double count = 0.0;         // number of sites
  size_t colour = 0;
  bool is_dark = false;
};

// Gain and read noise with their standard deviations.
struct PhotonTransfer {
  double gain_dn_per_electron = 0.0;
  double gain_sd = 0.0;
  std::array<double, 3> gain_rgb = {};  // gain of each colour alone
  std::array<double, 3> gain_rgb_sd = {};
  double read_noise_dn = 0.0;  // without the noise of rounding to whole DN
  double read_noise_sd = 0.0;
  double misfit = 0.0;  // root mean square deviation of the points, in standard deviations
  std::vector<TransferPoint> points;
};

/// Returns the noise of pairs of frames, lit and dark, of one light and one exposure. The
/// difference of a pair is free of shading, dust and fixed patterns. Patches of lit frames count
/// only where all sites are below `highest_dn`.
[[nodiscard]] std::vector<TransferPoint> TransferPoints(const ChartReadings& readings,
                                                        const std::vector<PatchSample>& samples,
                                                        double highest_dn);

/// Fits gain g and read noise sigma by photon transfer: least squares of
///
///     variance - 1/12 = g mean + sigma^2                                                    (1)
///
/// with weights (n - 1) / (2 variance^2). Their variances are those of (1) itself, so that weights
/// do not follow the noise of the points. 1/12 is the variance of rounding. Dark points are used
/// where `use_dark`.
///
/// Errors   kDegenerate: fewer than three lit points; no noise in them
/// Source   Janesick, "Photon Transfer", SPIE Press, 2007, chapter 5
[[nodiscard]] Result<PhotonTransfer> FitPhotonTransfer(std::vector<TransferPoint> points,
                                                       bool use_dark);

}  // namespace sateen
