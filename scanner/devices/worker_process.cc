#include "scanner/devices/worker_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "core/files/file_io.h"
#include "scanner/devices/worker_message.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr const char* kProgramName = "sateen-camera-worker";

// Starts the program without its output: what libgphoto2 prints answers no question of a person.
int SpawnQuietly(const std::string& program, int socket, pid_t& process) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, socket, STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  std::string name = program;
  std::array<char*, 2> words = {name.data(), nullptr};
  const int failed =
      posix_spawn(&process, program.c_str(), &actions, nullptr, words.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  return failed;
}

}  // namespace

fs::path WorkerProcess::DefaultProgram() {
  std::error_code failed;
  const fs::path folder = fs::read_symlink("/proc/self/exe", failed).parent_path();
  for (const char* place : {".", "../lib/sateen", "../libexec/sateen"}) {
    if (fs::path program = folder / place / kProgramName; fs::exists(program, failed)) {
      return program.lexically_normal();
    }
  }
  return folder / kProgramName;
}

Result<WorkerProcess> WorkerProcess::Start(const fs::path& program) {
  std::array<int, 2> sockets = {};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets.data()) != 0) {
    return Fail(ErrorCode::kIo, "no socket: {}", SystemReason(errno));
  }
  pid_t process = -1;
  const int failed = SpawnQuietly(program.string(), sockets[1], process);
  close(sockets[1]);
  if (failed != 0) {
    close(sockets[0]);
    return Fail(ErrorCode::kIo,
                "{}: cannot be started: {}; it comes with sateen and talks to cameras",
                program.string(), SystemReason(failed));
  }
  return WorkerProcess(process, sockets[0]);
}

WorkerProcess::WorkerProcess(WorkerProcess&& other) noexcept
    : process_(std::exchange(other.process_, -1)), socket_(std::exchange(other.socket_, -1)) {}

WorkerProcess& WorkerProcess::operator=(WorkerProcess&& other) noexcept {
  std::swap(process_, other.process_);
  std::swap(socket_, other.socket_);
  return *this;
}

Result<nlohmann::json> WorkerProcess::Ask(const nlohmann::json& request,
                                          std::chrono::milliseconds longest) {
  if (!Running()) {
    return Fail(ErrorCode::kDevice, "no process talks to the camera");
  }
  const Status sent = SendMessage(socket_, request);
  Result<nlohmann::json> answer =
      sent ? ReceiveMessage(socket_, longest) : tl::unexpected(sent.error());
  if (!answer) {
    Kill();
    if (answer.error().code == ErrorCode::kBadData) {
      return Fail(ErrorCode::kDevice, "the process that talks to the camera sent no answer: {}",
                  answer.error().message);
    }
  }
  return answer;
}

void WorkerProcess::Kill() noexcept {
  if (process_ > 0) {
    kill(process_, SIGKILL);
    while (waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  if (socket_ >= 0) {
    close(socket_);
  }
  process_ = -1;
  socket_ = -1;
}

}  // namespace sateen
