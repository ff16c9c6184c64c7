#include "cli/light.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <functional>
#include <ostream>
#include <utility>

#include "cli/choice.h"
#include "cli/light_report.h"
#include "core/quantity.h"
#include "rig/rig.h"
#include "scanner/daemon/board_job.h"
#include "scanner/daemon/light_job.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/serial_port.h"

namespace sateen::cli {
namespace {

using std::chrono::milliseconds;

std::optional<int> Number(const std::string& text) {
  int number = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && rest == text.data() + text.size() ? std::optional(number)
                                                                   : std::nullopt;
}

// Finds the channel of a light. A name of the rig comes before a number.
Result<int> FindChannel(const std::string& text, const std::filesystem::path& rig_file) {
  if (!rig_file.empty()) {
    const Result<Rig> rig = ReadRig(rig_file);
    if (!rig) {
      return tl::unexpected(rig.error());
    }
    const auto light = std::ranges::find(rig->lights, text, &Light::name);
    if (light != rig->lights.end()) {
      return light->channel;
    }
  }
  if (const std::optional<int> number = Number(text)) {
    return *number;
  }
  return rig_file.empty()
             ? Fail(ErrorCode::kInvalidArgument,
                    "'{}' is not the number of a light; for a light's name add --rig rig.json",
                    text)
             : Fail(ErrorCode::kInvalidArgument, "{} has no light '{}'", rig_file.string(), text);
}

// Finds the channel that the command line names, if it names one.
Result<std::optional<int>> NamedChannel(const LightArgs& args) {
  const bool limits = args.what == "limits";
  if (limits ? args.target.empty() : args.what == "status" || args.what == "off") {
    return std::optional<int>();
  }
  const Result<int> channel = FindChannel(limits ? args.target : args.what, args.rig);
  return channel ? Result<std::optional<int>>(*channel) : tl::unexpected(channel.error());
}

// The means of driving the board: over its port, or by the daemon.
struct LightRig {
  std::function<Result<BoardWord>(const BoardChange&)> change;
  std::function<Status()> all_off;
  std::function<Result<bool>(const LightRequest&, const std::function<void(const LightOn&)>&)>
      keep_on;
};

Status TurnOn(const LightArgs& args, int channel, const LightRig& rig, std::ostream& out) {
  const Result<double> level = ParseLevel(args.level);
  if (!level) {
    return tl::unexpected(level.error());
  }
  LightRequest request = {.channel = channel, .name = args.what, .level = *level};
  if (!args.on_time.empty()) {
    const Result<milliseconds> asked = ParseDuration(args.on_time);
    if (!asked) {
      return tl::unexpected(asked.error());
    }
    request.on_time = *asked;
  }
  const Result<bool> was_on = rig.keep_on(request, [&](const LightOn& on) {
    out << fmt::format("light {} on at {} for {}{}\n", args.what, LevelText(on.level),
                       args.on_time.empty() ? "at most " : "", DurationText(on.on_time))
        << std::flush;
  });
  if (!was_on) {
    return tl::unexpected(was_on.error());
  }
  out << fmt::format("light {} off\n", args.what);
  return {};
}

Result<BoardChange> ChangeOf(const LightArgs& args, std::optional<int> channel) {
  BoardChange change = {.clear_fault = args.clear_fault, .channel = channel};
  if (!args.max_level.empty()) {
    const Result<double> level = ParseLevel(args.max_level);
    if (!level) {
      return tl::unexpected(level.error());
    }
    change.max_level = *level;
  }
  if (!args.max_on.empty()) {
    const Result<milliseconds> time = ParseDuration(args.max_on);
    if (!time) {
      return tl::unexpected(time.error());
    }
    change.max_on = *time;
  }
  if (args.max_lit != 0) {
    change.max_lit = args.max_lit;
  }
  change.dim_clock = args.dim_clock;
  change.sync_rising = args.sync_rising;
  return change;
}

Status ShowBoard(const LightArgs& args, std::optional<int> channel, const LightRig& rig,
                 std::ostream& out) {
  const Result<BoardChange> change = ChangeOf(args, channel);
  if (!change) {
    return tl::unexpected(change.error());
  }
  const Result<BoardWord> word = rig.change(*change);
  if (!word) {
    return tl::unexpected(word.error());
  }
  if (args.what == "limits") {
    out << LimitsText(word->info);
  } else {
    out << (args.json ? StatusJson(word->port, word->info, word->report)
                      : StatusText(word->port, word->info, word->report));
  }
  return {};
}

Status Run(const LightArgs& args, std::optional<int> channel, const LightRig& rig,
           std::ostream& out) {
  if (args.what == "status" || args.what == "limits") {
    return ShowBoard(args, channel, rig, out);
  }
  if (args.what == "off") {
    Status off = rig.all_off();
    if (off) {
      out << "all lights off\n";
    }
    return off;
  }
  return TurnOn(args, *channel, rig, out);
}

int LightEnded(const Status& done, std::ostream& log) {
  if (!done) {
    log << "sateen light: error: " << done.error().message << '\n';
    return ExitStatus(done.error());
  }
  return 0;
}

}  // namespace

void AddLight(CLI::App& root, LightArgs& args) {
  CLI::App* cmd = root.add_subcommand(
      "light", "Turn a light of the LED board on or off, show the board's state, set its limits");
  cmd->add_option(
         "light", args.what,
         "Number or name of a light, which turns it on until Ctrl-C, the time of --for or its "
         "limit; 'off' for all lights; 'status'; or 'limits'")
      ->required();
  cmd->add_option("target", args.target, "With limits: number or name of a light; default: all");
  cmd->add_option("--level", args.level, "Level of the light, 0% (off), 0.1% to 100%")
      ->capture_default_str();
  cmd->add_option("--for", args.on_time, "Turn the light off after this long, as 500ms or 2s");
  cmd->add_option("--rig", args.rig, "Rig file with the names of the lights");
  cmd->add_option("--port", args.port,
                  "Serial port of the LED board, as /dev/ttyACM0; default: the one whose USB id is "
                  "an Arduino's")
      ->envname("SATEEN_PORT");
  cmd->add_flag("--clear-fault", args.clear_fault,
                "With status: acknowledge the fault that it shows");
  cmd->add_flag("--json", args.json, "With status: print JSON");
  cmd->add_option("--max-level", args.max_level, "With limits: highest level, as 80%");
  cmd->add_option("--max-on", args.max_on, "With limits: longest time on, 1ms to 60s");
  cmd->add_option("--max-lit", args.max_lit, "With limits: most lights that may be on together")
      ->check(CLI::Range(1, 16));
  AddNamedChoice(*cmd, "--dim", "With limits: frequency of the dimming line",
                 {DimClockText(0), DimClockText(1), DimClockText(2)}, std::nullopt,
                 [&args](size_t k) { args.dim_clock = static_cast<int>(k); });
  AddNamedChoice(*cmd, "--sync", "With limits: edge of the flash sync that fires a light",
                 {"falling", "rising"}, std::nullopt,
                 [&args](size_t k) { args.sync_rising = k == 1; });
  cmd->final_callback([&args] {
    const bool limits = args.what == "limits";
    if (!limits && (!args.target.empty() || !args.max_level.empty() || !args.max_on.empty() ||
                    args.max_lit != 0 || args.dim_clock || args.sync_rising)) {
      throw CLI::ValidationError(
          "a second light, --max-level, --max-on, --max-lit, --dim and --sync go with 'limits'");
    }
    if (args.what != "status" && (args.clear_fault || args.json)) {
      throw CLI::ValidationError("--clear-fault and --json go with 'status'");
    }
    if (!limits && args.what != "status" && args.what != "off") {
      // Before a port is opened: opening one restarts an Uno.
      const auto check = [](const auto& parsed) {
        if (!parsed) {
          throw CLI::ValidationError(parsed.error().message);
        }
      };
      check(ParseLevel(args.level));
      if (!args.on_time.empty()) {
        check(ParseDuration(args.on_time));
      }
    }
  });
}

int RunLight(const LightArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  if (args.port.empty()) {
    const Result<std::optional<DaemonClient>> daemon = FindDaemon();
    if (!daemon) {
      return LightEnded(tl::unexpected(daemon.error()), log);
    }
    if (*daemon) {
      return RunLightByDaemon(args, **daemon, task, out, log);
    }
  }
  return RunLightOn(args, MakeSerialPort(args.port), task, out, log);
}

int RunLightByDaemon(const LightArgs& args, const DaemonClient& daemon, const Task& task,
                     std::ostream& out, std::ostream& log) {
  const Result<std::optional<int>> channel = NamedChannel(args);
  if (!channel) {
    return LightEnded(tl::unexpected(channel.error()), log);
  }
  const LightRig rig = {
      .change = [&](const BoardChange& change) { return ChangeBoardByDaemon(daemon, change); },
      .all_off = [&] { return LightsOffByDaemon(daemon); },
      .keep_on =
          [&](const LightRequest& request, const auto& began) {
            return KeepLightOnByDaemon(daemon, request, task, began);
          }};
  return LightEnded(Run(args, *channel, rig, out), log);
}

int RunLightOn(const LightArgs& args, std::unique_ptr<BytePort> port, const Task& task,
               std::ostream& out, std::ostream& log) {
  // Before the port is opened, which restarts an Uno.
  const Result<std::optional<int>> channel = NamedChannel(args);
  if (!channel) {
    return LightEnded(tl::unexpected(channel.error()), log);
  }
  LightBoard board(std::move(port));
  if (const Status connected = board.Connect(); !connected) {
    return LightEnded(connected, log);
  }
  const LightRig rig = {
      .change = [&](const BoardChange& change) { return ChangeBoard(change, board); },
      .all_off =
          [&] {
            const Result<BoardState> off = board.AllOff();
            return off ? Status{} : tl::unexpected(off.error());
          },
      .keep_on = [&](const LightRequest& request,
                     const auto& began) { return KeepLightOn(request, board, task, began); }};
  return LightEnded(Run(args, *channel, rig, out), log);
}

}  // namespace sateen::cli
