#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "core/error.h"

namespace sateen {

// The process that talks to the camera (camera_worker/). It holds no file or socket of this one but
// the socket of its messages. Move-only.
class WorkerProcess {
 public:
  // Returns sateen-camera-worker beside this program, or in ../lib/sateen or ../libexec/sateen from
  // it.
  [[nodiscard]] static std::filesystem::path DefaultProgram();

  // Starts the program. kIo: it cannot be started.
  [[nodiscard]] static Result<WorkerProcess> Start(const std::filesystem::path& program);
  WorkerProcess(WorkerProcess&& other) noexcept;
  WorkerProcess& operator=(WorkerProcess&& other) noexcept;
  ~WorkerProcess() { Kill(); }

  // Sends one request and returns its answer. kTimeout: none within `longest`; the process is
  // killed then, because a later answer would be taken for that of another request. kDevice: the
  // process has ended.
  [[nodiscard]] Result<nlohmann::json> Ask(const nlohmann::json& request,
                                           std::chrono::milliseconds longest);
  [[nodiscard]] bool Running() const { return process_ > 0; }
  // Kills it with SIGKILL, since a hung call may ignore less, and waits until it is gone.
  void Kill() noexcept;

 private:
  WorkerProcess(pid_t process, int socket) : process_(process), socket_(socket) {}

  pid_t process_ = -1;
  int socket_ = -1;
};

}  // namespace sateen
