#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/response/chart_check.h"
#include "calibration/response/chart_readings.h"
#include "calibration/response/linearity.h"
#include "calibration/response/photon_transfer.h"
#include "calibration/response/white_balance.h"
#include "core/error.h"

namespace sateen {

struct ResponseFitOptions {
  LinearityOptions linearity;
  // Unevenness above which a patch is left out under a light; (0, 1].
  double most_uneven = 0.02;
  // Largest deviation of a frame's brightness from its exposure time; (0, 1].
  double most_off = 0.03;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Response of the sensor.
struct ResponseFit {
  double black_dn = 0.0;
  std::optional<double> saturation_dn;  // level of the colour that saturates first
  double white_dn = 0.0;  // lowest reading that does not count: saturated, or not linear
  Eigen::Vector3d white_balance = Eigen::Vector3d::Ones();  // geometric mean over the lights
  Eigen::Vector3d white_balance_sd = Eigen::Vector3d::Zero();
  std::vector<std::optional<LightBalance>> lights;  // [light]; nothing: no usable patch
  Linearity linearity;
  std::optional<PhotonTransfer> transfer;  // nothing where there were no pairs
  std::vector<UnevenPatch> uneven;
  std::vector<std::string> warnings;
};

/// Fits the response of the sensor to readings of a neutral chart under several exposures: black
/// level, linearity and saturation (linearity.h); gain and read noise (photon_transfer.h) and the
/// white balance of each light (white_balance.h) from patches below half of white.
///
/// Errors   kInvalidArgument: an option out of range
///          kBadData: no dark frame; a light under which all patches are dark or saturated; a frame
///          whose exposure time is wrong; fewer than three exposure times
[[nodiscard]] Result<ResponseFit> FitResponse(const ChartReadings& readings,
                                              const ResponseFitOptions& options = {});

}  // namespace sateen
