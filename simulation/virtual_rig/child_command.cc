#include "simulation/virtual_rig/child_command.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "core/files/file_io.h"

namespace sateen {

namespace {

// This process's variables, and `more` instead of those of the same name.
std::vector<std::string> EnvironmentWith(const std::map<std::string, std::string>& more) {
  std::vector<std::string> all;
  for (char** own = environ; *own != nullptr; ++own) {
    const std::string entry = *own;
    if (!more.contains(entry.substr(0, entry.find('=')))) {
      all.push_back(entry);
    }
  }
  for (const auto& [name, value] : more) {
    all.push_back(fmt::format("{}={}", name, value));
  }
  return all;
}

std::vector<char*> PointersTo(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (const std::string& text : texts) {
    pointers.push_back(const_cast<char*>(text.c_str()));  // exec does not write to them
  }
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

Result<pid_t> StartCommand(const std::vector<std::string>& command,
                           const std::map<std::string, std::string>& environment) {
  // Before the fork: other threads may be within malloc() then.
  const std::vector<std::string> variables = EnvironmentWith(environment);
  const std::vector<char*> names = PointersTo(variables);
  const std::vector<char*> words = PointersTo(command);
  // By what the child writes into it, exec failed; when it is closed, exec went well.
  std::array<int, 2> report = {};
  if (pipe2(report.data(), O_CLOEXEC) != 0) {
    return Fail(ErrorCode::kIo, "no pipe: {}", SystemReason(errno));
  }
  const pid_t child = fork();
  if (child == 0) {
    execvpe(words[0], words.data(), names.data());
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
                SystemReason(reason));
  }
  return child;
}

int ExitStatusOf(int wait_status) {
  return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);
}

}  // namespace sateen
