#include "cli/light.h"

#include <algorithm>
#include <charconv>
#include <ostream>
#include <utility>

#include "cli/light_report.h"
#include "cli/quantity.h"
#include "rig/rig.h"
#include "scanner/light_board.h"
#include "scanner/serial_port.h"

namespace sateen::cli {
namespace {

using std::chrono::milliseconds;

// Often enough for the board's 2 s of silence, and for noticing at once that a light went off.
constexpr milliseconds kKeepAlive{250};
// How soon Ctrl-C is heard.
constexpr milliseconds kStep{50};

std::optional<int> Number(const std::string& text) {
  int number = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && rest == text.data() + text.size() ? std::optional(number)
                                                                   : std::nullopt;
}

// A name of the rig's comes before a number.
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
                    "'{}' is no number of a light; names are looked up in a rig: --rig rig.json",
                    text)
             : Fail(ErrorCode::kInvalidArgument, "{} has no light '{}'", rig_file.string(), text);
}

// The channel that the command line names, if it names one.
Result<std::optional<int>> NamedChannel(const LightArgs& args) {
  const bool limits = args.what == "limits";
  if (limits ? args.target.empty() : args.what == "status" || args.what == "off") {
    return std::optional<int>();
  }
  const Result<int> channel = FindChannel(limits ? args.target : args.what, args.rig);
  return channel ? Result<std::optional<int>>(*channel) : tl::unexpected(channel.error());
}

// What the light did until it went off, by itself or by Ctrl-C.
struct Lit {
  bool cancelled = false;
  milliseconds lasted{0};  // as the board last said
  int fault = 0;
};

// Stays with the light: the board turns it off when it hears nothing.
Result<Lit> StayUntilOff(LightBoard& board, int channel, const Task& task) {
  Lit lit;
  while (true) {
    for (milliseconds waited{0}; waited < kKeepAlive && !task.Cancelled(); waited += kStep) {
      board.Wait(kStep);
    }
    if (task.Cancelled()) {
      lit.cancelled = true;
      const Result<BoardState> off = board.AllOff();
      return off ? Result<Lit>(lit) : tl::unexpected(off.error());
    }
    const Result<BoardReport> report = board.Report();
    if (!report) {
      return tl::unexpected(report.error());
    }
    lit.fault = report->state.fault;
    if ((report->state.lit >> channel & 1u) == 0) {
      return lit;
    }
    lit.lasted = report->state.lit_for;
  }
}

Status TurnOn(const LightArgs& args, int channel, LightBoard& board, const Task& task,
              std::ostream& out) {
  const Result<double> level = ParseLevel(args.level);
  if (!level) {
    return tl::unexpected(level.error());
  }
  const auto index = static_cast<std::size_t>(channel);
  milliseconds on_time = channel >= 0 && index < board.Info().lights.size()
                             ? board.Info().lights[index].max_on
                             : milliseconds(1);
  if (!args.on_time.empty()) {
    const Result<milliseconds> asked = ParseDuration(args.on_time);
    if (!asked) {
      return tl::unexpected(asked.error());
    }
    on_time = *asked;
  }
  const Result<BoardState> on = board.SetLight(channel, *level, on_time);
  if (!on) {
    return tl::unexpected(on.error());
  }
  if (*level == 0.0) {
    out << fmt::format("light {} off\n", args.what);
    return {};
  }
  out << fmt::format("light {} on at {} for {}{}\n", args.what, LevelText(on->level),
                     args.on_time.empty() ? "at most " : "", DurationText(on_time))
      << std::flush;
  const Result<Lit> lit = StayUntilOff(board, channel, task);
  if (!lit) {
    return tl::unexpected(lit.error());
  }
  if (lit->fault != on->fault && lit->fault != 0) {
    return Fail(ErrorCode::kDevice, "light {} went off: fault {}: {}", args.what, lit->fault,
                FaultText(lit->fault));
  }
  if (!lit->cancelled && args.on_time.empty()) {
    return Fail(
        ErrorCode::kDevice,
        "light {} went off after {}, the longest that it may be on; if the LED bears more on its "
        "heat sink, raise that by 'sateen light limits {} --max-on TIME'",
        args.what, DurationText(on_time), args.what);
  }
  out << fmt::format("light {} off\n", args.what);
  return {};
}

Status ShowStatus(const LightArgs& args, LightBoard& board, std::ostream& out) {
  if (args.clear_fault) {
    const Result<BoardState> cleared = board.ClearFault(board.Info().fault);
    if (!cleared) {
      return tl::unexpected(cleared.error());
    }
  }
  const Result<BoardReport> report = board.Report();
  if (!report) {
    return tl::unexpected(report.error());
  }
  out << (args.json ? StatusJson(board.PortName(), board.Info(), *report)
                    : StatusText(board.PortName(), board.Info(), *report));
  return {};
}

Status SetLimits(const LightArgs& args, std::optional<int> named, LightBoard& board) {
  std::optional<double> max_level;
  std::optional<milliseconds> max_on;
  if (!args.max_level.empty()) {
    const Result<double> level = ParseLevel(args.max_level);
    if (!level) {
      return tl::unexpected(level.error());
    }
    max_level = *level;
  }
  if (!args.max_on.empty()) {
    const Result<milliseconds> time = ParseDuration(args.max_on);
    if (!time) {
      return tl::unexpected(time.error());
    }
    max_on = *time;
  }
  if (!max_level && !max_on) {
    return {};
  }
  const int first = named.value_or(0);
  const int last = named.value_or(static_cast<int>(board.Info().lights.size()) - 1);
  for (int channel = first; channel <= last; ++channel) {
    const auto index = static_cast<std::size_t>(channel);
    const LightLimits old = channel >= 0 && index < board.Info().lights.size()
                                ? board.Info().lights[index]
                                : LightLimits{.max_on = milliseconds(1)};
    const Result<BoardState> set = board.Limit(
        channel,
        {.max_level = max_level.value_or(old.max_level), .max_on = max_on.value_or(old.max_on)});
    if (!set) {
      return tl::unexpected(set.error());
    }
  }
  return {};
}

Status Configure(const LightArgs& args, LightBoard& board) {
  if (args.max_lit == 0 && args.dim.empty() && args.sync.empty()) {
    return {};
  }
  BoardSettings settings = board.Info().settings;
  if (args.max_lit != 0) {
    settings.max_lit = args.max_lit;
  }
  for (int dim_clock = 0; dim_clock < 3; ++dim_clock) {
    if (args.dim == DimClockText(dim_clock)) {
      settings.dim_clock = dim_clock;
    }
  }
  if (!args.sync.empty()) {
    settings.sync_rising = args.sync == "rising";
  }
  const Result<BoardState> set = board.Configure(settings);
  return set ? Status{} : tl::unexpected(set.error());
}

Status Run(const LightArgs& args, LightBoard& board, const Task& task, std::ostream& out) {
  // Before the port is opened, which restarts an Uno.
  const Result<std::optional<int>> channel = NamedChannel(args);
  if (!channel) {
    return tl::unexpected(channel.error());
  }
  if (Status connected = board.Connect(); !connected) {
    return connected;
  }
  if (args.what == "status") {
    return ShowStatus(args, board, out);
  }
  if (args.what == "limits") {
    Status set = SetLimits(args, *channel, board);
    if (set) {
      set = Configure(args, board);
    }
    if (set) {
      out << LimitsText(board.Info());
    }
    return set;
  }
  if (args.what == "off") {
    const Result<BoardState> off = board.AllOff();
    if (!off) {
      return tl::unexpected(off.error());
    }
    out << "all lights off\n";
    return {};
  }
  return TurnOn(args, **channel, board, task, out);
}

}  // namespace

void AddLight(CLI::App& root, LightArgs& args) {
  CLI::App* cmd = root.add_subcommand(
      "light", "Turn a light of the LED board on or off, show its state, set its limits");
  cmd->add_option("light", args.what,
                  "Number or name of a light: turns it on until Ctrl-C, the time of --for or its "
                  "limit; 'off': all lights; 'status'; 'limits'")
      ->required();
  cmd->add_option("target", args.target, "Of limits: number or name of a light; default: all");
  cmd->add_option("--level", args.level, "Level of the light, 0% (off), 0.1% to 100%")
      ->capture_default_str();
  cmd->add_option("--for", args.on_time, "Turn the light off after this long, as 500ms or 2s");
  cmd->add_option("--rig", args.rig, "Rig file in which names of lights are looked up");
  cmd->add_option("--port", args.port,
                  "Serial port of the LED board, as /dev/ttyACM0; default: the one whose USB id is "
                  "an Arduino's")
      ->envname("SATEEN_PORT");
  cmd->add_flag("--clear-fault", args.clear_fault,
                "Of status: acknowledge the fault that it shows");
  cmd->add_flag("--json", args.json, "Of status: print JSON");
  cmd->add_option("--max-level", args.max_level, "Of limits: highest level, as 80%");
  cmd->add_option("--max-on", args.max_on, "Of limits: longest time on, 1ms to 60s");
  cmd->add_option("--max-lit", args.max_lit, "Of limits: lights that may be on together")
      ->check(CLI::Range(1, 16));
  cmd->add_option("--dim", args.dim, "Of limits: frequency of the dimming line")
      ->check(CLI::IsMember({"16kHz", "2kHz", "250Hz"}));
  cmd->add_option("--sync", args.sync, "Of limits: edge of the flash sync that fires a light")
      ->check(CLI::IsMember({"falling", "rising"}));
  cmd->final_callback([&args] {
    const bool limits = args.what == "limits";
    if (!limits && (!args.target.empty() || !args.max_level.empty() || !args.max_on.empty() ||
                    args.max_lit != 0 || !args.dim.empty() || !args.sync.empty())) {
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
  return RunLightOn(args, MakeSerialPort(args.port), task, out, log);
}

int RunLightOn(const LightArgs& args, std::unique_ptr<BytePort> port, const Task& task,
               std::ostream& out, std::ostream& log) {
  LightBoard board(std::move(port));
  const Status done = Run(args, board, task, out);
  if (!done) {
    log << "sateen light: error: " << done.error().message << '\n';
    return ExitStatus(done.error());
  }
  return 0;
}

}  // namespace sateen::cli
