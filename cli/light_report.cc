#include "cli/light_report.h"

#include <array>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/json.h"
#include "core/quantity.h"

namespace sateen::cli {
namespace {

// "3 at 50 %, on for 120 ms, off in 380 ms", or "none".
std::string LitText(const BoardState& state) {
  std::string text;
  for (const int channel : LitChannels(state.lit)) {
    text += fmt::format("{}{}", text.empty() ? "" : ", ", channel);
  }
  if (text.empty()) {
    return "none";
  }
  return fmt::format("{} at {}, on for {}, off in {}", text, LevelText(state.level),
                     DurationText(state.lit_for), DurationText(state.left));
}

}  // namespace

std::string DimClockText(int dim_clock) {
  constexpr std::array kTexts = {"16kHz", "2kHz", "250Hz"};
  return dim_clock >= 0 && dim_clock < static_cast<int>(kTexts.size())
             ? kTexts[static_cast<std::size_t>(dim_clock)]
             : "unknown";
}

std::string StatusText(const std::string& port, const BoardInfo& info, const BoardReport& report) {
  const BoardState& state = report.state;
  std::string text = fmt::format("LED board    {}, firmware {}, protocol {}\n", port, info.build_id,
                                 info.protocol);
  text += fmt::format("started      {} ago: {}\n", DurationText(report.uptime), report.reset_cause);
  text += fmt::format("lights       {}; on: {}\n", info.lights.size(), LitText(state));
  if (state.armed >= 0) {
    text += fmt::format("armed        {} waits for the flash sync\n", state.armed);
  }
  if (state.shutter.count() > 0) {
    text += fmt::format("shutter      closed for another {}\n", DurationText(state.shutter));
  }
  text += state.fault == 0 ? "fault        none\n"
                           : fmt::format("fault        {}: {}; --clear-fault acknowledges it\n",
                                         state.fault, FaultText(state.fault));
  text += fmt::format("commands     {} received, {} refused, {} repeated\n", report.frames,
                      report.refused, report.repeats);
  text += fmt::format("line         {} bad frames, {} bytes lost, {} answers unsent\n",
                      report.bad_frames, report.overruns, report.unsent);
  text += fmt::format("flash sync   {} edges, {} lights fired\n", report.syncs, report.flashes);
  return text;
}

std::string StatusJson(const std::string& port, const BoardInfo& info, const BoardReport& report) {
  const BoardState& state = report.state;
  nlohmann::json limits = nlohmann::json::array();
  for (const LightLimits& light : info.lights) {
    limits.push_back({{"max_level", light.max_level}, {"max_on_ms", light.max_on.count()}});
  }
  const nlohmann::json json = {
      {"schema", "sateen.light/1"},
      {"port", port},
      {"firmware", info.build_id},
      {"protocol", info.protocol},
      {"settings",
       {{"max_lit", info.settings.max_lit},
        {"dim", DimClockText(info.settings.dim_clock)},
        {"sync", info.settings.sync_rising ? "rising" : "falling"}}},
      {"limits", limits},
      {"state",
       {{"lit", LitChannels(state.lit)},
        {"level", state.level},
        {"lit_for_ms", state.lit_for.count()},
        {"left_ms", state.left.count()},
        {"armed", state.armed < 0 ? nlohmann::json() : nlohmann::json(state.armed)},
        {"shutter_ms", state.shutter.count()},
        {"fault", state.fault},
        {"fault_text", FaultText(state.fault)}}},
      {"reset_cause", report.reset_cause},
      {"uptime_ms", report.uptime.count()},
      {"counters",
       {{"frames", report.frames},
        {"bad_frames", report.bad_frames},
        {"overruns", report.overruns},
        {"refused", report.refused},
        {"repeats", report.repeats},
        {"unsent", report.unsent},
        {"syncs", report.syncs},
        {"flashes", report.flashes},
        {"faults", report.faults}}}};
  return JsonText(json, 2) + '\n';
}

std::string LimitsText(const BoardInfo& info) {
  std::string text = "light  max level  max on-time\n";
  for (std::size_t channel = 0; channel < info.lights.size(); ++channel) {
    const LightLimits& light = info.lights[channel];
    text += fmt::format("{:>5}  {:>9}  {:>11}\n", channel, LevelText(light.max_level),
                        DurationText(light.max_on));
  }
  text += fmt::format("\nlights on together: {}; dimming line: {}; flash sync: {} edge\n",
                      info.settings.max_lit, DimClockText(info.settings.dim_clock),
                      info.settings.sync_rising ? "rising" : "falling");
  return text;
}

}  // namespace sateen::cli
