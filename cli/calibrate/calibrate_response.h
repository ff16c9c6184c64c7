#pragma once

#include <filesystem>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>

#include "calibration/response/response_fit.h"
#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/rig_calibration.h"
#include "rig/rig.h"
#include "scanner/sessions/chart_reader.h"

namespace sateen::cli {

struct CalibrateResponseArgs {
  std::filesystem::path chart;    // the session
  std::filesystem::path patches;  // the chart's file
  std::filesystem::path output;   // the rig file
  std::filesystem::path rig;      // to start from; empty: the session's own
  ResponseFitOptions fit;
  FindChartOptions find;
  int threads = 0;
  bool json = false;
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
};

/// Gives a rig the response that was measured. Fluxes are in balanced units (scanner/sessions/sensor_reading.h),
/// so a new balance changes them too, or albedos would change colour:
///
///     phi_kc' = phi_kc w_c / w_c(before)          measured by white paper, or of no frame here  (1)
///     phi_kc' = phi_kG' w_c / w_kc                otherwise: the light's colour on the chart     (2)
///
/// w_kc is the balance of light k alone, w_c that of all.
void AdoptResponse(const ResponseFit& fit, Rig& rig);

void AddCalibrateResponse(CLI::App& calibrate, CalibrateResponseArgs& args);
int RunCalibrateResponse(const CalibrateResponseArgs& args, const Task& task, std::ostream& out,
                         std::ostream& log);

}  // namespace sateen::cli
