#pragma once

#include <filesystem>
#include <optional>

#include "calibration/response/response_fit.h"
#include "core/task.h"
#include "pipelines/calibrate/rig_calibration.h"
#include "scanner/sessions/chart_reader.h"

namespace sateen {

struct CalibrateResponseOptions {
  std::filesystem::path chart;    // the session
  std::filesystem::path patches;  // the chart's file
  std::filesystem::path output;   // the rig file
  std::filesystem::path rig;      // to start from; empty: what is at `output`, or the session's own
  ResponseFitOptions fit;
  FindChartOptions find;
};

// Relative errors against truth/rig.json of a simulated chart.
struct ResponseErrors {
  double white_balance = 0.0;  // of the worst light and colour
  std::optional<double> gain;
  std::optional<double> read_noise;
  std::optional<double> saturation;  // of its height above black
};

struct ResponseCalibration : RigCalibration {
  ChartSession capture;
  ResponseFit fit;
  double tolerance = 0.01;  // of linearity
  std::optional<ResponseErrors> errors;
  ResponseRecord record;
};

/// Gives a rig the response that was measured. Fluxes are in balanced units
/// (scanner/sessions/frames/sensor_reading.h), so a new balance changes them too, or albedos would change
/// colour:
///
///     phi_kc' = phi_kc w_c / w_c(before)     measured by white paper, or without a frame here (1)
///     phi_kc' = phi_kG' w_c / w_kc           otherwise: the light's colour on the chart       (2)
///
/// w_kc: balance of light k alone; w_c: balance of all lights.
void AdoptResponse(const ResponseFit& fit, Rig& rig);

/// Fits the sensor's response to a session of a grey chart (calibration/response/response_fit.h),
/// draws the pictures of response_pictures.h and writes the rig with the new response.
///
/// Errors   as ReadChartFile(), ReadChart(), FitResponse(), ReadRig()
///          kCancelled: nothing is written
[[nodiscard]] Result<ResponseCalibration> CalibrateResponseFromChart(
    const CalibrateResponseOptions& options, const Task& task = {});

}  // namespace sateen
