#include "pipelines/calibrate/calibrate_response.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/sha256.h"
#include "core/stopwatch.h"
#include "pipelines/calibrate/pictures/response_pictures.h"
#include "pipelines/calibrate/response_record.h"
#include "pipelines/calibrate/rig_record.h"
#include "scanner/sessions/files/chart_file.h"

namespace sateen {
namespace {

// Returns the white balance that a light's flux, given under `response_balance`, implies.
Eigen::Vector3d BalanceOf(const Light& light, const Eigen::Vector3d& response_balance) {
  return (light.flux_rgb[1] / response_balance[1]) * response_balance.cwiseQuotient(light.flux_rgb);
}

Result<std::optional<ResponseErrors>> ErrorsOf(const std::filesystem::path& dir,
                                               const ResponseFit& fit, const Rig& rig) {
  const Result<std::optional<Rig>> truth = ReadTrueRig(dir);
  if (!truth) {
    return tl::unexpected(truth.error());
  }
  if (!*truth || !(*truth)->response) {
    return std::optional<ResponseErrors>();
  }
  const Lights& lights = (*truth)->lights;
  const Response& expected = *(*truth)->response;
  ResponseErrors errors;
  for (size_t k = 0; k < fit.lights.size(); ++k) {
    const auto light = std::ranges::find(lights, rig.lights[k].name, &Light::name);
    if (fit.lights[k] && light != lights.end()) {
      const Eigen::Vector3d off =
          fit.lights[k]->white_balance.cwiseQuotient(BalanceOf(*light, expected.white_balance));
      errors.white_balance =
          std::max(errors.white_balance, (off - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff());
    }
  }
  if (fit.transfer && expected.gain_dn_per_electron && expected.read_noise_dn) {
    errors.gain =
        std::abs(fit.transfer->gain_dn_per_electron / *expected.gain_dn_per_electron - 1.0);
    errors.read_noise = std::abs(fit.transfer->read_noise_dn / *expected.read_noise_dn - 1.0);
  }
  if (fit.saturation_dn) {
    errors.saturation =
        std::abs((*fit.saturation_dn - expected.black) / (expected.white - expected.black) - 1.0);
  }
  return std::optional(errors);
}

}  // namespace

void AdoptResponse(const ResponseFit& fit, Rig& rig) {
  const bool are_measured = rig.calibration.lights.has_value();
  rig.lights = Rebalanced(std::move(rig.lights), WhiteBalanceOf(rig), fit.white_balance);  // (1)
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    Eigen::Vector3d& flux = rig.lights[k].flux_rgb;
    if (!are_measured && fit.lights[k]) {
      flux = flux[1] * fit.white_balance.cwiseQuotient(fit.lights[k]->white_balance);  // (2)
    }
  }
  Response response{.black = fit.black_dn, .white = fit.white_dn};
  response.white_balance = fit.white_balance;
  if (fit.transfer) {
    response.gain_dn_per_electron = fit.transfer->gain_dn_per_electron;
    response.read_noise_dn = fit.transfer->read_noise_dn;
  }
  rig.response = response;
}

Result<ResponseCalibration> CalibrateResponseFromChart(const CalibrateResponseOptions& options,
                                                       const Task& task) {
  const Stopwatch stopwatch;
  const Result<Chart> chart = ReadChartFile(options.patches);
  if (!chart) {
    return tl::unexpected(chart.error());
  }
  const Result<std::string> chart_hash = Sha256OfFile(options.patches);
  if (!chart_hash) {
    return tl::unexpected(chart_hash.error());
  }
  ReadChartOptions read{.find = options.find};
  read.rig_file = RigFileToBeginWith(options.rig, options.output);
  Result<ChartSession> capture = ReadChart(options.chart, *chart, read, task);
  if (!capture) {
    return tl::unexpected(capture.error());
  }
  Result<ResponseFit> fit = FitResponse(capture->readings, options.fit);
  if (!fit) {
    return Fail(fit.error().code, "{}: {}", options.chart.string(), fit.error().message);
  }
  ResponseCalibration result;
  BeginCalibration(options.output, "response", result);
  result.rig = capture->rig;
  result.sha256_of_input = capture->sha256_of_input;
  result.sha256_of_input[options.patches.string()] = *chart_hash;
  result.warnings = fit->warnings;
  result.capture = std::move(*capture);
  result.fit = std::move(*fit);
  result.tolerance = options.fit.linearity.tolerance;
  AdoptResponse(result.fit, result.rig);
  const Result<std::optional<ResponseErrors>> errors =
      ErrorsOf(options.chart, result.fit, result.rig);
  if (!errors) {
    return tl::unexpected(errors.error());
  }
  result.errors = *errors;
  Status status = task.CheckCancelled().and_then([&] { return DrawResponse(result); });
  if (!status) {
    return tl::unexpected(status.error());
  }
  result.seconds = stopwatch.Seconds();
  result.record = RecordOf(result);
  status = RecordAndWrite(WithoutBins(result.record), &CalibrationRecords::response, result);
  if (!status) {
    return tl::unexpected(status.error());
  }
  return result;
}

}  // namespace sateen
