#include "cli/calibrate/calibrate_response.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "cli/calibrate/calibrate_response_pictures.h"
#include "cli/calibrate/calibrate_response_report.h"
#include "core/sha256.h"
#include "pipelines/calibrate/rig_record.h"
#include "scanner/sessions/files/chart_file.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

bool AreFluxesMeasured(const Rig& rig) {
  return !rig.calibration_json.empty() &&
         nlohmann::json::parse(rig.calibration_json, nullptr, /*allow_exceptions=*/false)
             .contains("lights");
}

// What a light's flux says of its balance, in the units of the response that it is given in.
Eigen::Vector3d BalanceOf(const Light& light, const Eigen::Vector3d& response_balance) {
  return (light.flux_rgb[1] / response_balance[1]) * response_balance.cwiseQuotient(light.flux_rgb);
}

Result<std::optional<ResponseErrors>> ErrorsOf(const fs::path& dir, const ResponseFit& fit,
                                               const Rig& rig) {
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

Result<ResponseCalibration> Calibrate(const CalibrateResponseArgs& args, const Task& task) {
  const auto start = std::chrono::steady_clock::now();
  const Result<Chart> chart = ReadChartFile(args.patches);
  if (!chart) {
    return tl::unexpected(chart.error());
  }
  const Result<std::string> chart_hash = Sha256OfFile(args.patches);
  if (!chart_hash) {
    return tl::unexpected(chart_hash.error());
  }
  ReadChartOptions options{.find = args.find};
  options.rig_file = RigFileToBeginWith(args.rig, args.output);
  Result<ChartSession> capture = ReadChart(args.chart, *chart, options, task);
  if (!capture) {
    return tl::unexpected(capture.error());
  }
  Result<ResponseFit> fit = FitResponse(capture->readings, args.fit);
  if (!fit) {
    return Fail(fit.error().code, "{}: {}", args.chart.string(), fit.error().message);
  }
  ResponseCalibration result;
  result.rig = capture->rig;
  result.sha256_of_input = capture->sha256_of_input;
  result.sha256_of_input[args.patches.string()] = *chart_hash;
  result.warnings = fit->warnings;
  result.capture = std::move(*capture);
  result.fit = std::move(*fit);
  result.tolerance = args.fit.linearity.tolerance;
  AdoptResponse(result.fit, result.rig);
  const Result<std::optional<ResponseErrors>> errors = ErrorsOf(args.chart, result.fit, result.rig);
  if (!errors) {
    return tl::unexpected(errors.error());
  }
  result.errors = *errors;
  result.pictures = args.output;
  result.pictures.replace_filename(args.output.stem().string() + "-response");
  if (Status status = task.CheckCancelled().and_then([&] { return DrawResponse(result); });
      !status) {
    return tl::unexpected(status.error());
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace

void AdoptResponse(const ResponseFit& fit, Rig& rig) {
  const bool are_measured = AreFluxesMeasured(rig);
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

void AddCalibrateResponse(CLI::App& calibrate, CalibrateResponseArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "response", "Linearity, saturation, noise and white balance from a neutral grey chart");
  cmd->add_option("chart", args.chart,
                  "Session of kind chart: RAW frames of several exposures, in pairs, and dark ones")
      ->required();
  cmd->add_option("--patches", args.patches,
                  "The chart's patches: places and reflectances, as samples/charts/neutral.json")
      ->required();
  cmd->add_option("-o,--output", args.output, "Rig file to write; a former one is kept as a copy")
      ->required();
  cmd->add_option("--rig", args.rig,
                  "Rig to start from: camera with its pose, lights; default: what is at -o, or "
                  "else the session's own");
  cmd->add_option("--tolerance", args.fit.linearity.tolerance,
                  "Of proportionality, for the linear range; above 0 and up to 0.2")
      ->capture_default_str();
  cmd->add_option("--max-shift", args.find.max_shift_mm,
                  "How far from the table's middle the chart is looked for [mm]")
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the table");
}

int RunCalibrateResponse(const CalibrateResponseArgs& args, const Task& task, std::ostream& out,
                         std::ostream& log) {
  Result<ResponseCalibration> result = Calibrate(args, task.WithThreads(args.threads));
  task.ClearProgress();
  return FinishCalibration("response", args, std::move(result), out, log);
}

}  // namespace sateen::cli
