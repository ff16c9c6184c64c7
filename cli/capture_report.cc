#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "cli/capture.h"
#include "core/json.h"
#include "core/quantity.h"

namespace sateen::cli {
namespace {

// Returns the exposures of the lit frames, ascending.
std::vector<double> ExposuresOf(const std::vector<SessionFrame>& frames) {
  std::set<double> exposures_s;
  for (const SessionFrame& frame : frames) {
    if (frame.role == FrameRole::kLit) {
      exposures_s.insert(frame.exposure_s.value_or(0.0));
    }
  }
  return {exposures_s.begin(), exposures_s.end()};
}

std::string ExposuresText(const std::vector<double>& exposures_s) {
  std::string text;
  for (const double exposure_s : exposures_s) {
    text += (text.empty() ? "" : ", ") + ExposureText(exposure_s);
  }
  return text;
}

double LargestShift(const CaptureCheck& check) {
  double largest = 0.0;
  for (const Shift& shift : check.shifts) {
    largest = std::max(largest, shift.px.norm());
  }
  return largest;
}

double Megabytes(std::uintmax_t bytes) { return static_cast<double>(bytes) / 1e6; }

}  // namespace

std::string CaptureText(const std::filesystem::path& session, const Rig& rig,
                        const CaptureSummary& summary) {
  const std::vector<SessionFrame>& frames = summary.session.frames;
  const CaptureCheck& check = summary.check;
  std::string text = fmt::format("{}: {} frames, {} taken in {:.1f} s", session.string(),
                                 frames.size(), summary.taken, summary.seconds);
  if (summary.kept > 0) {
    text += fmt::format(", {} kept from before", summary.kept);
  }
  if (summary.rejected > 0) {
    text += fmt::format(", {} rejected and taken again", summary.rejected);
  }
  text += fmt::format("\nexposure {}, f/{:g}, ISO {:g}\n", ExposuresText(ExposuresOf(frames)),
                      frames[0].f_number.value_or(0.0), frames[0].iso.value_or(0.0));
  text += "brightness relative to the calibration:";
  for (std::size_t k = 0; k < check.levels.size(); ++k) {
    text += fmt::format("{} {} {:.1f} %", k == 0 ? "" : ",", rig.lights[k].name,
                        100.0 * check.levels[k]);
  }
  text += fmt::format("\nchange from start to end: '{}' {:+.2f} %; ambient light {:+.3f} %",
                      rig.lights[0].name, 100.0 * check.drift, 100.0 * check.ambient);
  if (!check.shifts.empty()) {
    text += fmt::format(", largest shift of the picture {:.2f} px", LargestShift(check));
  }
  text += '\n';
  for (const std::string& note : check.notes) {
    text += "note: " + note + '\n';
  }
  return text;
}

std::string CaptureJson(const std::filesystem::path& session, const Rig& rig,
                        const CaptureSummary& summary) {
  const CaptureCheck& check = summary.check;
  nlohmann::ordered_json json = {{"schema", "sateen.capture/1"},
                                 {"session", session.string()},
                                 {"kind", Name(summary.session.kind)},
                                 {"frames", summary.session.frames.size()},
                                 {"taken", summary.taken},
                                 {"kept", summary.kept},
                                 {"rejected", summary.rejected},
                                 {"exposures_s", ExposuresOf(summary.session.frames)},
                                 {"f_number", summary.session.frames[0].f_number.value_or(0.0)},
                                 {"iso", summary.session.frames[0].iso.value_or(0.0)},
                                 {"lights", nlohmann::ordered_json::array()},
                                 {"drift", check.drift},
                                 {"ambient", check.ambient}};
  for (std::size_t k = 0; k < check.levels.size(); ++k) {
    json["lights"].push_back({{"name", rig.lights[k].name}, {"level", check.levels[k]}});
  }
  for (const Shift& shift : check.shifts) {
    json["shifts_px"].push_back({shift.px.x(), shift.px.y()});
  }
  json["notes"] = check.notes;
  json["seconds"] = summary.seconds;
  json["camera_seconds"] = summary.camera_seconds;
  return JsonText(json, 2) + "\n";
}

std::string ForecastText(const CaptureForecast& forecast) {
  const CaptureOptions& options = forecast.request.options;
  return fmt::format(
      "ready to capture {} frames into {}\n"
      "board   {}, firmware {}\n"
      "camera  {} at {}, profile {}\n"
      "exposure {}, f/{:g}, ISO {:g}, lights at {}\n"
      "about {:.0f} MB per series of exposures; {:.0f} MB are free\n",
      forecast.plan.size(), forecast.request.output.string(), forecast.port, forecast.firmware,
      forecast.camera.model, forecast.camera.port, forecast.camera.profile,
      forecast.exposure_known
          ? ExposureText(forecast.settings.exposure_s)
          : fmt::format("from test frames, up to {} per light",
                        options.kind == SessionKind::kSheet ? 1 : options.brackets),
      forecast.settings.f_number, forecast.settings.iso, LevelText(options.level),
      Megabytes(forecast.bytes), Megabytes(forecast.free_bytes));
}

std::string ForecastJson(const CaptureForecast& forecast) {
  nlohmann::ordered_json json = {{"schema", "sateen.capture.forecast/1"},
                                 {"session", forecast.request.output.string()},
                                 {"kind", Name(forecast.request.options.kind)},
                                 {"frames", nlohmann::ordered_json::array()},
                                 {"port", forecast.port},
                                 {"firmware", forecast.firmware},
                                 {"camera", forecast.camera.model},
                                 {"camera_port", forecast.camera.port},
                                 {"profile", forecast.camera.profile},
                                 {"f_number", forecast.settings.f_number},
                                 {"iso", forecast.settings.iso},
                                 {"bytes", forecast.bytes},
                                 {"free_bytes", forecast.free_bytes}};
  for (const SessionFrame& frame : forecast.plan) {
    nlohmann::ordered_json planned = {{"role", Name(frame.role)}};
    if (frame.role != FrameRole::kDark) {
      planned["light"] = frame.light;
    }
    json["frames"].push_back(std::move(planned));
  }
  if (forecast.exposure_known) {
    json["exposure_s"] = forecast.settings.exposure_s;
  }
  return JsonText(json, 2) + "\n";
}

}  // namespace sateen::cli
