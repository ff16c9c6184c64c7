#include "cli/calibrate/calibrate_response_report.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/angle.h"
#include "core/version.h"

namespace sateen::cli {
namespace {

constexpr std::array<std::string_view, 3> kChannelNames = {"red", "green", "blue"};

nlohmann::json ListOf(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

template <typename T>
nlohmann::json OrNull(const std::optional<T>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json();
}

nlohmann::json LinearityJson(const ChannelLinearity& channel) {
  nlohmann::json json = {{"from_dn", channel.linear_from_dn},
                         {"to_dn", channel.linear_to_dn},
                         {"departs", channel.departs},
                         {"fine_to_dn", OrNull(channel.fine_to_dn)},
                         {"saturation_dn", OrNull(channel.saturation_dn)},
                         {"bins", nlohmann::json::array()}};
  for (const LinearityBin& bin : channel.bins) {
    json["bins"].push_back(
        {{"level_dn", bin.level_dn}, {"deviation", bin.deviation}, {"sd", bin.sd}});
  }
  return json;
}

nlohmann::json NoiseJson(const PhotonTransfer& transfer) {
  return {{"gain_dn_per_electron", transfer.gain_dn_per_electron},
          {"gain_sd", transfer.gain_sd},
          {"gain_rgb", transfer.gain_rgb},
          {"gain_rgb_sd", transfer.gain_rgb_sd},
          {"read_noise_dn", transfer.read_noise_dn},
          {"read_noise_sd", transfer.read_noise_sd},
          {"misfit", transfer.misfit},
          {"points", transfer.points.size()}};
}

nlohmann::json LightsJson(const ResponseCalibration& result) {
  nlohmann::json lights = nlohmann::json::array();
  for (size_t k = 0; k < result.fit.lights.size(); ++k) {
    if (const std::optional<LightBalance>& balance = result.fit.lights[k]) {
      lights.push_back({{"name", result.rig.lights[k].name},
                        {"white_balance", ListOf(balance->white_balance)},
                        {"white_balance_sd", ListOf(balance->sd)},
                        {"patches", balance->patches}});
    }
  }
  return lights;
}

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

}  // namespace

std::string JsonReport(const CalibrateResponseArgs& args, const ResponseCalibration& result) {
  const ResponseFit& fit = result.fit;
  const Eigen::Isometry2d& pose = result.capture.pose.table_from_chart;
  nlohmann::json report = {{"schema", "sateen.calibrate.response/1"},
                           {"version", Version()},
                           {"output", args.output.string()},
                           {"former_rig", result.former_rig.string()},
                           {"pictures", result.pictures.string()},
                           {"seconds", result.seconds},
                           {"warnings", result.warnings},
                           {"inputs", result.sha256_of_input},
                           {"frames", result.capture.readings.frames.size()},
                           {"chart",
                            {{"at_mm", {pose.translation().x(), pose.translation().y()}},
                             {"turned_deg", Eigen::Rotation2Dd(pose.linear()).angle() / kRadPerDeg},
                             {"misfit", result.capture.pose.misfit}}},
                           {"black_dn", fit.black_dn},
                           {"saturation_dn", OrNull(fit.saturation_dn)},
                           {"white_dn", fit.white_dn},
                           {"tolerance", args.fit.linearity.tolerance},
                           {"linearity", nlohmann::json::object()},
                           {"noise", fit.transfer ? NoiseJson(*fit.transfer) : nlohmann::json()},
                           {"white_balance", ListOf(fit.white_balance)},
                           {"white_balance_sd", ListOf(fit.white_balance_sd)},
                           {"lights", LightsJson(result)},
                           {"left_out", nlohmann::json::array()}};
  for (size_t c = 0; c < 3; ++c) {
    report["linearity"][kChannelNames[c]] = LinearityJson(fit.linearity.rgb[c]);
  }
  for (const UnevenPatch& uneven : fit.uneven) {
    report["left_out"].push_back({{"light", result.rig.lights[uneven.light].name},
                                  {"patch", result.capture.readings.patch_names[uneven.patch]},
                                  {"unevenness", uneven.unevenness}});
  }
  if (result.errors) {
    report["error"] = {{"white_balance", result.errors->white_balance},
                       {"gain", OrNull(result.errors->gain)},
                       {"read_noise", OrNull(result.errors->read_noise)},
                       {"saturation", OrNull(result.errors->saturation)}};
  }
  return report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TextReport(const CalibrateResponseArgs& args, const ResponseCalibration& result) {
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
  if (!result.former_rig.empty()) {
    text += fmt::format("the former rig is kept as {}\n", result.former_rig.string());
  }
  return text + fmt::format("{} is written after {:.1f} s; look at {}\n", args.output.string(),
                            result.seconds, (result.pictures / "linearity.svg").string());
}

}  // namespace sateen::cli
