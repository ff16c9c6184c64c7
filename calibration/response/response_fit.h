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
  double most_uneven = 0.02;  // a patch above this is left out under that light; (0, 1]
  double most_off =
      0.03;  // a frame's brightness against its exposure time, above: an error; (0, 1]

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

struct ResponseFit {
  double black_dn = 0.0;
  std::optional<double> saturation_dn;  // of the colour that saturates first
  double white_dn = 0.0;  // readings from here on do not count: saturated, or not linear
  Eigen::Vector3d white_balance = Eigen::Vector3d::Ones();  // all lights, geometric mean
  Eigen::Vector3d white_balance_sd = Eigen::Vector3d::Zero();
  std::vector<std::optional<LightBalance>> lights;  // nothing: no frame of it
  Linearity linearity;
  std::optional<PhotonTransfer> transfer;  // nothing where there were no pairs
  std::vector<UnevenPatch> uneven;
  std::vector<std::string> warnings;
};

/// What the sensor does to light, from a neutral chart under several exposures: black level,
/// linearity and saturation (calibration/response/linearity.h), gain and read noise
/// (calibration/response/photon_transfer.h), and the white balance of each light
/// (calibration/response/white_balance.h), these last three of patches that read less than half of white.
///
/// Errors   kInvalidArgument: an option out of range
///          kBadData: no dark frame; a light under which all patches are dark or saturated; a frame
///          whose exposure time is wrong; fewer than three exposure times
[[nodiscard]] Result<ResponseFit> FitResponse(const ChartReadings& readings,
                                              const ResponseFitOptions& options = {});

}  // namespace sateen
