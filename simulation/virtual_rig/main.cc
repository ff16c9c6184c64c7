#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/files/file_io.h"
#include "core/interrupt.h"
#include "rig/rig.h"
#include "simulation/virtual_rig/board/light_log.h"
#include "simulation/virtual_rig/camera/rig_camera.h"
#include "simulation/virtual_rig/child_command.h"
#include "simulation/virtual_rig/rig_args.h"
#include "simulation/virtual_rig/rig_commands.h"
#include "simulation/virtual_rig/rig_loop.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

void Complain(const Error& error) {
  // In one piece: it may come from any thread.
  std::cerr << fmt::format("sateen-virtual-rig: error: {}\n", error.message);
}

// Looks beside this program, where the build and `make install` put what belongs to it.
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

// Names of the lights by channel: of the rig file, else of the scene's rig.
Result<std::vector<std::string>> LightNames(const RigArgs& args, int lights) {
  std::vector<std::string> names;
  const std::string& scene = args.camera.scene;
  const std::string path = args.rig.empty() ? scene : args.rig;
  if (path.empty()) {
    return names;
  }
  const Result<Rig> rig = args.rig.empty() ? ReadSceneRig(scene) : ReadRig(args.rig);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  for (int k = 0; k < lights; ++k) {
    names.push_back(fmt::format("channel {}", k));
  }
  for (const Light& light : rig->lights) {
    if (light.channel < 0 || light.channel >= lights) {
      return Fail(ErrorCode::kBadData,
                  "{}: light '{}' is on channel {}; the board has channels 0 to {}", path,
                  light.name, light.channel, lights - 1);
    }
    names[static_cast<size_t>(light.channel)] = light.name;
  }
  if (!scene.empty() && !args.rig.empty()) {
    const Result<Rig> scene_rig = ReadSceneRig(scene);
    const Status same = scene_rig ? RequireSameRig(*scene_rig, scene, *rig, args.rig)
                                  : tl::unexpected(scene_rig.error());
    if (!same) {
      return tl::unexpected(same.error());
    }
  }
  return names;
}

// Returns the environment in which a program takes the virtual board for a serial port.
Result<RigLoop::Environment> PreloadEnvironment(const VirtualPort& port) {
  const fs::path preload =
      FindBeside({"libsateen-virtual-port.so", "../lib/sateen/libsateen-virtual-port.so"});
  if (!fs::exists(preload)) {
    return Fail(ErrorCode::kIo, "{}: is not there; build the target sateen-virtual-port",
                preload.string());
  }
  // This program has one thread yet.
  const char* before = std::getenv("LD_PRELOAD");  // NOLINT(concurrency-mt-unsafe)
  const std::string others = before != nullptr && *before != '\0' ? fmt::format(":{}", before) : "";
  return RigLoop::Environment{{"LD_PRELOAD", preload.string() + others},
                              {"SATEEN_VIRTUAL_PORT", port.Folder().string()}};
}

Result<int> RunCommand(const RigArgs& args, RigLoop& loop, RigCommands& commands,
                       const RigLoop::Environment& environment) {
  // A daemon that runs on this computer has a real rig, and must not get the command's jobs.
  RigLoop::Environment of_command = environment;
  of_command["SATEEN_SOCKET"] = "";
  const Result<pid_t> child = StartCommand(args.command, of_command);
  if (!child) {
    return tl::unexpected(child.error());
  }
  int wait_status = 0;
  bool told = false;
  while (waitpid(*child, &wait_status, WNOHANG) == 0) {
    // Ctrl-C reaches the command by itself; SIGTERM to this program does not.
    if (InterruptFlag() && !std::exchange(told, true)) {
      kill(*child, SIGTERM);
    }
    commands.Step();
    loop.Step();
  }
  return ExitStatusOf(wait_status);
}

// Commands from standard input, a line each, until it ends.
class CommandReader {
 public:
  // Returns false once told to quit.
  bool Step(RigCommands& commands) {
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
      const Status done = line.empty() ? Status() : commands.Do(line);
      if (!done) {
        Complain(done.error());
      }
    }
    return true;
  }

 private:
  bool ended_ = false;
  std::string text_;
};

int Serve(RigLoop& loop, RigCommands& commands, const RigLoop::Environment& environment) {
  std::string exports = "export";
  for (const auto& [name, value] : environment) {
    exports += fmt::format(" {}='{}'", name, value);
  }
  std::cerr << exports << '\n';
  CommandReader reader;
  while (!InterruptFlag() && reader.Step(commands)) {
    commands.Step();
    loop.Step();
  }
  return 0;
}

// Actions for the start; those for captures go to `commands`.
Result<std::vector<RigAction>> ParseCommands(const RigArgs& args, RigCommands& commands) {
  std::vector<RigAction> actions;
  for (const std::string& line : args.faults) {
    Result<RigAction> action = commands.Parse(line);
    if (!action) {
      return tl::unexpected(action.error());
    }
    actions.push_back(*std::move(action));
  }
  for (const std::string& text : args.scheduled) {
    if (const Status scheduled = commands.Schedule(text); !scheduled) {
      return tl::unexpected(scheduled.error());
    }
  }
  return actions;
}

Result<int> RunRig(const RigArgs& args, const std::string& firmware, RigLoop& loop, LightLog& log,
                   RigLoop::Environment environment) {
  RigCommands commands(loop, Complain);
  std::unique_ptr<RigCamera> camera;
  if (!args.camera.scene.empty()) {
    auto started = RigCamera::Start(args.camera, log, loop, commands, {.cancel = &InterruptFlag()});
    if (!started) {
      return tl::unexpected(started.error());
    }
    camera = *std::move(started);
    environment["SATEEN_CAMERA"] = camera->PortName();
  }
  const Result<std::vector<RigAction>> actions = ParseCommands(args, commands);
  if (!actions) {
    return tl::unexpected(actions.error());
  }
  loop.Start(firmware, environment);
  for (const RigAction& action : *actions) {
    if (const Status done = action.act(); !done) {
      return tl::unexpected(done.error());
    }
  }
  Result<int> status = args.command.empty() ? Serve(loop, commands, environment)
                                            : RunCommand(args, loop, commands, environment);
  commands.Step();  // events that the camera has posted
  loop.End();
  return status;
}

Result<int> Run(const RigArgs& args) {
  const std::string image =
      args.lights == 16 ? "sateen-controller-16.hex" : "sateen-controller.hex";
  const std::string firmware =
      args.firmware.empty() ? FindBeside({"../avr/" + image, "../share/sateen/" + image}).string()
                            : args.firmware;
  auto board = VirtualBoard::Load(firmware, ControllerWiring(args.lights));
  if (!board) {
    return tl::unexpected(board.error());
  }
  auto names = LightNames(args, (*board)->LightCount());
  if (!names) {
    return tl::unexpected(names.error());
  }
  auto port =
      VirtualPort::Open({}, args.port_link.empty() ? std::nullopt : std::optional(args.port_link));
  if (!port) {
    return tl::unexpected(port.error());
  }
  const auto environment = PreloadEnvironment(*port);
  if (!environment) {
    return tl::unexpected(environment.error());
  }
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(nullptr, &std::fclose);
  if (!args.events.empty()) {
    file.reset(std::fopen(args.events.c_str(), "we"));
    if (file == nullptr) {
      return Fail(ErrorCode::kIo, "{}: cannot be written: {}", args.events, SystemReason(errno));
    }
  }
  std::FILE* events = file != nullptr ? file.get() : args.command.empty() ? stdout : nullptr;
  prctl(PR_SET_TIMERSLACK, 1000UL);  // or each wait of 100 us takes 50 us longer
  LightLog log((*board)->LightCount(), args.camera.rise);
  RigLoop loop(**board, *port,
               {.names = *names,
                .opening_resets = args.opening_resets,
                .events = events,
                .light_log = &log});
  return RunRig(args, firmware, loop, log, *environment);
}

}  // namespace
}  // namespace sateen

int main(int argc, char** argv) {
  sateen::RigArgs args;
  if (const std::optional<int> status = sateen::ParseRigArgs(argc, argv, args)) {
    return *status;
  }
  sateen::InstallInterruptHandlers();
  const sateen::Result<int> status = sateen::Run(args);
  if (!status) {
    sateen::Complain(status.error());
    return sateen::ExitStatus(status.error());
  }
  return *status;
}
