#include "cli/serve.h"

#include <CLI/CLI.hpp>
#include <chrono>
#include <optional>
#include <ostream>
#include <thread>
#include <utility>
#include <vector>

#include "core/version.h"
#include "scanner/daemon/api.h"
#include "scanner/daemon/http/access.h"
#include "scanner/daemon/http/http_server.h"
#include "scanner/daemon/http/listener.h"
#include "scanner/daemon/rig_service.h"

namespace sateen::cli {
namespace {

// Longest delay until a signal is noticed.
constexpr std::chrono::milliseconds kSignalStep{50};

struct Door {
  Listener listener;
  std::optional<AccessRules> access;
};

// Opens every listener that is asked for, or fails before the rig is touched.
Result<std::vector<Door>> OpenDoors(const ServeArgs& args) {
  std::vector<Door> doors;
  std::string token;
  if (!args.listen.empty()) {
    if (args.token_file.empty()) {
      return Fail(ErrorCode::kInvalidArgument,
                  "--listen without --token-file: any program and any web page of this computer "
                  "could drive the rig; make a token: (umask 077; openssl rand -hex 32 > token)");
    }
    Result<std::string> read = ReadTokenFile(args.token_file);
    if (!read) {
      return tl::unexpected(read.error());
    }
    token = *std::move(read);
  }
  Result<Listener> local =
      Listener::OnUnixSocket(args.socket.empty() ? DefaultSocketPath() : args.socket);
  if (!local) {
    return tl::unexpected(local.error());
  }
  doors.push_back({.listener = *std::move(local)});
  if (!args.listen.empty()) {
    Result<Listener> loopback = Listener::OnLoopback(args.listen);
    if (!loopback) {
      return tl::unexpected(loopback.error());
    }
    const int port = loopback->Port();
    doors.push_back({.listener = *std::move(loopback), .access = AccessRules(token, port)});
  }
  return doors;
}

}  // namespace

void AddServe(CLI::App& root, ServeArgs& args) {
  CLI::App* cmd = root.add_subcommand(
      "serve",
      "Run the daemon, which owns the LED board and the camera and serves programs over a socket "
      "(docs/api.md); other commands use it. Ends on Ctrl-C or SIGTERM, with all lights off");
  cmd->add_option(
         "--socket", args.socket,
         "Unix socket; default: $XDG_RUNTIME_DIR/sateen.sock, or /run/sateen/sateen.sock without "
         "that folder")
      ->envname("SATEEN_SOCKET");
  CLI::Option* listen =
      cmd->add_option("--listen", args.listen,
                      "Also listen on TCP, at 127.0.0.1:PORT or [::1]:PORT; port 0: any free port");
  CLI::Option* token =
      cmd->add_option("--token-file", args.token_file,
                      "File of mode 0600; TCP clients must send its first line as bearer token");
  listen->needs(token);
  token->needs(listen);
  cmd->add_option("--port", args.devices.port,
                  "Serial port of the LED board, as /dev/ttyACM0; default: the one whose USB id is "
                  "an Arduino's")
      ->envname("SATEEN_PORT");
  cmd->add_option("--camera", args.devices.camera,
                  "Camera: ptpip:ADDRESS, usb:BUS,DEVICE or folder:DIR; default: the only one on "
                  "USB")
      ->envname("SATEEN_CAMERA");
}

int RunServe(const ServeArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  return RunServeOn(args, std::make_unique<RigDevices>(args.devices), {}, task, out, log);
}

int RunServeOn(const ServeArgs& args, std::unique_ptr<RigDevices> devices,
               const CaptureOptions& capture, const Task& task, std::ostream& out,
               std::ostream& log) {
  Result<std::vector<Door>> doors = OpenDoors(args);
  if (!doors) {
    log << "sateen serve: error: " << doors.error().message << '\n';
    return ExitStatus(doors.error());
  }
  RigService service(std::move(devices));
  const Api api(service, {.version = Version(), .capture = capture});
  std::vector<std::unique_ptr<HttpServer>> servers;
  for (Door& door : *doors) {
    servers.push_back(std::make_unique<HttpServer>(std::move(door.listener), api, service,
                                                   std::move(door.access)));
    out << "listening on " << servers.back()->GetListener().Name() << '\n' << std::flush;
  }
  while (!task.Cancelled()) {
    std::this_thread::sleep_for(kSignalStep);
  }
  // The job first: its followers are told its end before their connections are closed.
  service.Stop();
  const std::string fault = service.State().lights_fault;
  servers.clear();
  if (!fault.empty()) {
    log << "sateen serve: error: " << fault << '\n';
    return ExitStatus({ErrorCode::kDevice, fault});
  }
  out << "all lights off; ended\n";
  return 0;
}

}  // namespace sateen::cli
