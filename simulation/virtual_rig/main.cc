#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "core/file_io.h"
#include "core/interrupt.h"
#include "rig/rig.h"
#include "simulation/virtual_rig/rig_loop.h"

namespace {

namespace fs = std::filesystem;
using sateen::Error;
using sateen::ErrorCode;
using sateen::Fail;
using sateen::Result;
using sateen::Status;

struct Args {
  std::string rig;
  std::string firmware;  // empty: ours for as many lights
  int lights = 14;
  std::string port_link;
  std::string events;
  bool opening_resets = false;
  std::vector<std::string> command;
};

// Beside this program, where the build and `make install` put what belongs to it.
fs::path FindBeside(const std::vector<std::string>& candidates) {
  std::error_code failed;
  const fs::path folder = fs::read_symlink("/proc/self/exe", failed).parent_path();
  for (const std::string& candidate : candidates) {
    if (const fs::path path = folder / candidate; fs::exists(path, failed)) {
      return fs::weakly_canonical(path, failed);
    }
  }
  return folder / candidates.front();
}

Result<std::vector<std::string>> LightNames(const std::string& path, int lights) {
  std::vector<std::string> names;
  if (path.empty()) {
    return names;
  }
  const Result<sateen::Rig> rig = sateen::ReadRig(path);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  for (int k = 0; k < lights; ++k) {
    names.push_back(fmt::format("channel {}", k));
  }
  for (const sateen::Light& light : rig->lights) {
    if (light.channel < 0 || light.channel >= lights) {
      return Fail(ErrorCode::kBadData,
                  "{}: light '{}' is on channel {}; the board has channels 0 to {}", path,
                  light.name, light.channel, lights - 1);
    }
    names[static_cast<size_t>(light.channel)] = light.name;
  }
  return names;
}

// What a program is started with that shall take the virtual board for a serial port.
Result<sateen::RigLoop::Environment> PreloadEnvironment(const sateen::VirtualPort& port) {
  const fs::path preload =
      FindBeside({"libsateen-virtual-port.so", "../lib/sateen/libsateen-virtual-port.so"});
  if (!fs::exists(preload)) {
    return Fail(ErrorCode::kIo, "{}: is not there; build the target sateen-virtual-port",
                preload.string());
  }
  // This program has one thread.
  const char* before = std::getenv("LD_PRELOAD");  // NOLINT(concurrency-mt-unsafe)
  const std::string others = before != nullptr && *before != '\0' ? ":" + std::string(before) : "";
  return sateen::RigLoop::Environment{{"LD_PRELOAD", preload.string() + others},
                                      {"SATEEN_VIRTUAL_PORT", port.Folder().string()}};
}

Result<pid_t> StartCommand(const std::vector<std::string>& command,
                           const sateen::RigLoop::Environment& environment) {
  std::vector<char*> words;
  words.reserve(command.size() + 1);
  for (const std::string& word : command) {
    words.push_back(const_cast<char*>(word.c_str()));  // execvp() does not write to them
  }
  words.push_back(nullptr);
  // By what the child writes into it, exec failed; when it is closed, exec went well.
  std::array<int, 2> report = {};
  if (pipe2(report.data(), O_CLOEXEC) != 0) {
    return Fail(ErrorCode::kIo, "no pipe: {}", sateen::SystemReason(errno));
  }
  const pid_t child = fork();
  if (child == 0) {
    for (const auto& [name, value] : environment) {
      setenv(name.c_str(), value.c_str(), 1);  // NOLINT(concurrency-mt-unsafe)
    }
    execvp(words[0], words.data());
    const int reason = errno;
    const ssize_t ignored = write(report[1], &reason, sizeof reason);
    _exit(ignored > 0 ? 127 : 126);
  }
  close(report[1]);
  int reason = child < 0 ? errno : 0;
  if (child > 0 && read(report[0], &reason, sizeof reason) != sizeof reason) {
    reason = 0;
  }
  close(report[0]);
  if (reason != 0) {
    if (child > 0) {
      waitpid(child, nullptr, 0);
    }
    return Fail(ErrorCode::kInvalidArgument, "'{}' cannot be started: {}", command[0],
                sateen::SystemReason(reason));
  }
  return child;
}

// As a shell has it: 128 and the signal's number where it was killed.
int ExitStatusOf(int wait_status) {
  return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);
}

int RunCommand(const Args& args, sateen::RigLoop& loop,
               const sateen::RigLoop::Environment& environment) {
  const Result<pid_t> child = StartCommand(args.command, environment);
  if (!child) {
    std::cerr << "sateen-virtual-rig: error: " << child.error().message << '\n';
    return ExitStatus(child.error());
  }
  int wait_status = 0;
  bool told = false;
  while (waitpid(*child, &wait_status, WNOHANG) == 0) {
    // Ctrl-C reaches the command by itself; SIGTERM to this program does not.
    if (sateen::InterruptFlag() && !std::exchange(told, true)) {
      kill(*child, SIGTERM);
    }
    loop.Step();
  }
  return ExitStatusOf(wait_status);
}

// Commands from standard input, a line each, until it ends.
class CommandReader {
 public:
  // False once told to quit.
  bool Step(sateen::RigLoop& loop) {
    pollfd input = {.fd = 0, .events = POLLIN, .revents = 0};
    if (ended_ || poll(&input, 1, 0) != 1) {
      return true;
    }
    std::array<char, 256> bytes = {};
    const ssize_t count = read(0, bytes.data(), bytes.size());
    ended_ = count <= 0;
    text_.append(bytes.data(), static_cast<size_t>(std::max<ssize_t>(count, 0)));
    for (size_t end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
      const std::string line = text_.substr(0, end);
      text_.erase(0, end + 1);
      if (line == "quit") {
        return false;
      }
      if (const Status done = loop.Command(line); !done && !line.empty()) {
        std::cerr << "sateen-virtual-rig: error: " << done.error().message << '\n';
      }
    }
    return true;
  }

 private:
  bool ended_ = false;
  std::string text_;
};

int Serve(sateen::RigLoop& loop, const sateen::RigLoop::Environment& environment) {
  std::string exports = "export";
  for (const auto& [name, value] : environment) {
    exports += fmt::format(" {}='{}'", name, value);
  }
  std::cerr << exports << '\n';
  CommandReader commands;
  while (!sateen::InterruptFlag() && commands.Step(loop)) {
    loop.Step();
  }
  return 0;
}

Result<int> Run(const Args& args) {
  const std::string image =
      args.lights == 16 ? "sateen-controller-16.hex" : "sateen-controller.hex";
  const std::string firmware =
      args.firmware.empty() ? FindBeside({"../avr/" + image, "../share/sateen/" + image}).string()
                            : args.firmware;
  auto board = sateen::VirtualBoard::Load(firmware, sateen::ControllerWiring(args.lights));
  if (!board) {
    return tl::unexpected(board.error());
  }
  auto names = LightNames(args.rig, (*board)->LightCount());
  if (!names) {
    return tl::unexpected(names.error());
  }
  auto port = sateen::VirtualPort::Open(
      {}, args.port_link.empty() ? std::nullopt : std::optional(args.port_link));
  if (!port) {
    return tl::unexpected(port.error());
  }
  const auto environment = PreloadEnvironment(*port);
  if (!environment) {
    return tl::unexpected(environment.error());
  }
  const bool serve = args.command.empty();
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(nullptr, &std::fclose);
  if (!args.events.empty()) {
    file.reset(std::fopen(args.events.c_str(), "we"));
    if (file == nullptr) {
      return Fail(ErrorCode::kIo, "{}: cannot be written: {}", args.events,
                  sateen::SystemReason(errno));
    }
  }
  std::FILE* events = file != nullptr ? file.get() : serve ? stdout : nullptr;
  prctl(PR_SET_TIMERSLACK, 1000UL);  // or each wait of 100 us takes 50 us longer
  sateen::RigLoop loop(**board, *port,
                       {.names = *names, .opening_resets = args.opening_resets, .events = events});
  loop.Start(firmware, *environment);
  const int status = serve ? Serve(loop, *environment) : RunCommand(args, loop, *environment);
  loop.End();
  return status;
}

void AddOptions(CLI::App& app, Args& args) {
  app.add_option("--rig", args.rig, "Rig file; names the lights in the events");
  app.add_option("--lights", args.lights, "Lights of the board, 14 or 16")
      ->check(CLI::IsMember({14, 16}))
      ->capture_default_str();
  app.add_option("--firmware", args.firmware,
                 "Firmware image to run, ELF or Intel HEX; default: ours for as many lights");
  app.add_flag("--opening-resets", args.opening_resets,
               "Opening the port resets the board for 1 s, as it does an Arduino Uno");
  app.add_option("--events", args.events, "Write what the lights do to this file, as JSON lines");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "An LED board without hardware: the controller's own firmware in a simulated ATmega328P, in "
      "real time,\nwith its serial line on a pseudo terminal.",
      "sateen-virtual-rig");
  Args args;
  AddOptions(app, args);
  app.add_option("--port-link", args.port_link,
                 "Make this path a link to the pseudo terminal while the board is plugged in");
  CLI::App* run = app.add_subcommand(
      "run", "Start the rig, run a command that finds it as /dev/ttyACM0, and end with its status");
  AddOptions(*run, args);
  run->add_option("command", args.command, "The command and its arguments, after --")
      ->required()
      ->option_text("-- COMMAND ARGUMENTS ...");
  app.footer(
      "Without a command it runs until Ctrl-C, prints what the lights do as JSON lines, and reads\n"
      "  reset, unplug, plug, brown-out [MS], flash [MS], quit\n"
      "from standard input, a line each. The first event holds the environment in which another "
      "shell\n"
      "starts programs that find the board. Or start both at once:\n"
      "  sateen-virtual-rig run --rig samples/rigs/ring10.json -- sateen light 3 --level 50%\n"
      "Exit status: as that of sateen; with `run` that of the command.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  sateen::InstallInterruptHandlers();
  const Result<int> status = Run(args);
  if (!status) {
    std::cerr << "sateen-virtual-rig: error: " << status.error().message << '\n';
    return ExitStatus(status.error());
  }
  return *status;
}
