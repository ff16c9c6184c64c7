#include "cli/calibrate/calibrate_response.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <limits>

#include "cli/calibrate/calibration_report.h"
#include "core/angle.h"

namespace sateen::cli {
namespace {

constexpr std::array<std::string_view, 3> kChannelNames = {"red", "green", "blue"};

std::string LinearityText(const ResponseCalibration& result) {
  std::string text =
      fmt::format("\n{:<10}{:>8}{:>16}{:>16}{:>17} [DN]\n", "linear", "from",
                  fmt::format("to, {:g} %", 100.0 * result.tolerance),
                  fmt::format("to, {:g} %", 100.0 * kFineTolerance), "saturated from");
  const auto dn = [](const std::optional<double>& value, std::string_view none) {
    return value ? fmt::format("{:.0f}", *value) : std::string(none);
  };
  bool is_open = false;
  double sheets_dn = std::numeric_limits<double>::infinity();
  for (size_t c = 0; c < 3; ++c) {
    const ChannelLinearity& channel = result.fit.linearity.rgb[c];
    is_open = is_open || !channel.departs;
    sheets_dn = std::min(sheets_dn, channel.fine_to_dn.value_or(0.0));
    text +=
        fmt::format("  {:<8}{:>8.0f}{:>16}{:>16}{:>17}\n", kChannelNames[c], channel.linear_from_dn,
                    fmt::format("{}{:.0f}", channel.departs ? "" : "> ", channel.linear_to_dn),
                    dn(channel.fine_to_dn, "not known"), dn(channel.saturation_dn, "not seen"));
  }
  if (is_open) {
    text += "  >: no patch tells of what is brighter\n";
  }
  if (sheets_dn > 0.0) {
    text += fmt::format(
        "  expose white paper to half or two thirds of white, at most to {:.0f} DN\n", sheets_dn);
  }
  return text;
}

std::string BalanceText(const ResponseCalibration& result) {
  std::string text = "\nwhite balance      red      +-    blue      +-  patches\n";
  const auto row = [](std::string_view name, const Eigen::Vector3d& value,
                      const Eigen::Vector3d& sd) {
    return fmt::format("  {:<12} {:>8.4f} {:>7.4f} {:>7.4f} {:>7.4f}", name, value[0], sd[0],
                       value[2], sd[2]);
  };
  for (size_t k = 0; k < result.fit.lights.size(); ++k) {
    if (const std::optional<LightBalance>& balance = result.fit.lights[k]) {
      text += fmt::format("{} {:>8}\n",
                          row(result.rig.lights[k].name, balance->white_balance, balance->sd),
                          balance->patches);
    }
  }
  return text + row("all", result.fit.white_balance, result.fit.white_balance_sd) + "\n\n";
}

std::string NoiseText(const ResponseFit& fit) {
  if (!fit.transfer) {
    return "";
  }
  const PhotonTransfer& transfer = *fit.transfer;
  return fmt::format(
      "gain        {:.5f} +- {:.5f} DN per electron; full well {:.0f} electrons\n"
      "read noise  {:.3f} +- {:.3f} DN, {:.2f} electrons\n",
      transfer.gain_dn_per_electron, transfer.gain_sd,
      (fit.saturation_dn.value_or(fit.white_dn) - fit.black_dn) / transfer.gain_dn_per_electron,
      transfer.read_noise_dn, transfer.read_noise_sd,
      transfer.read_noise_dn / transfer.gain_dn_per_electron);
}

std::string ErrorsText(const ResponseErrors& errors) {
  const auto percent = [](const std::optional<double>& error) {
    return error ? fmt::format("{:.3g} %", 100.0 * *error) : std::string("unknown");
  };
  return fmt::format(
      "error against truth/rig.json: white balance {} at most, gain {}, read noise {}, saturation "
      "{}\n",
      percent(errors.white_balance), percent(errors.gain), percent(errors.read_noise),
      percent(errors.saturation));
}

std::string TextReport(const ResponseCalibration& result) {
  const ResponseFit& fit = result.fit;
  const ChartReadings& readings = result.capture.readings;
  const Eigen::Isometry2d& pose = result.capture.pose.table_from_chart;
  std::string text = fmt::format(
      "chart       {} patches at ({:.1f}, {:.1f}) mm, turned by {:.1f} degrees; {} frames\n"
      "black       {:.2f} DN; the files say {:g}\n"
      "white       {:.0f} DN, from where readings do not count; the files say {:g}\n",
      readings.patches.size(), pose.translation().x(), pose.translation().y(),
      Eigen::Rotation2Dd(pose.linear()).angle() / kRadPerDeg, readings.frames.size(), fit.black_dn,
      readings.file_black_dn, fit.white_dn, readings.file_white_dn);
  text += NoiseText(fit) + LinearityText(result) + BalanceText(result);
  if (result.errors) {
    text += ErrorsText(*result.errors);
  }
  return text + FilesText(result, (result.pictures / "linearity.svg").string());
}

}  // namespace

void AddCalibrateResponse(CLI::App& calibrate, CalibrateResponseArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "response", "Linearity, saturation, noise and white balance from a neutral grey chart");
  CalibrateResponseOptions& options = args.options;
  cmd->add_option("chart", options.chart,
                  "Session of kind chart: RAW frames of several exposures, in pairs, and dark ones")
      ->required();
  cmd->add_option("--patches", options.patches,
                  "The chart's patches: places and reflectances, as samples/charts/neutral.json")
      ->required();
  cmd->add_option("-o,--output", options.output,
                  "Rig file to write; one that exists is kept as a copy")
      ->required();
  cmd->add_option("--rig", options.rig,
                  "Rig with the camera, its pose and the lights; default: the one at --output, or "
                  "else the session's own");
  cmd->add_option("--tolerance", options.fit.linearity.tolerance,
                  "Largest deviation from proportionality within the linear range (0, 0.2]")
      ->capture_default_str();
  cmd->add_option("--max-shift", options.find.max_shift_mm,
                  "Largest distance of the chart from the table's middle [mm]")
      ->capture_default_str();
  AddThreadsAndJson(*cmd, args.threads, args.json);
}

int RunCalibrateResponse(const CalibrateResponseArgs& args, const Task& task, std::ostream& out,
                         std::ostream& log) {
  const Result<ResponseCalibration> result =
      CalibrateResponseFromChart(args.options, task.WithThreads(args.threads));
  task.ClearProgress();
  return FinishCalibration("response", args.json, result, TextReport, out, log);
}

}  // namespace sateen::cli
