#include <gmock/gmock.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include "tests/scanner/daemon/hostile_clients.h"
#include "tests/simulation/virtual_rig/running_rig.h"
#include "tests/testing/files.h"

// `sateen serve` as a process of its own, and its end.
namespace sateen::testing::daemon_program_test {
namespace {

using ::testing::HasSubstr;

// A program with its standard output and error in a file.
class Program {
 public:
  Program(std::vector<std::string> words, const std::filesystem::path& log) {
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    std::vector<char*> arguments;
    for (std::string& word : words) {
      arguments.push_back(word.data());
    }
    arguments.push_back(nullptr);
    EXPECT_EQ(posix_spawn(&pid_, arguments[0], &actions, nullptr, arguments.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
  }
  void Signal(int signal) const { kill(pid_, signal); }
  // Waits for its end and returns its exit status, or 128 and the signal.
  int Wait() {
    int status = 0;
    waitpid(std::exchange(pid_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t pid_ = -1;
};

// Requests whose files never come take nothing that SIGTERM waits for.
TEST(DaemonProgram, EndsOnSigtermUnderRequestsForSpecialFiles) {
  const TempFolder folder;
  const std::filesystem::path socket = folder.Path() / "s.sock";
  const std::string fifo = (folder.Path() / "fifo").string();
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  Program daemon({kSateen, "serve", "--socket", socket.string(), "--port", "/nowhere/tty"},
                 folder.Path() / "log");
  while (!RawClient(socket).Connected()) {
    std::this_thread::yield();
  }
  const std::string output = (folder.Path() / "out").string();
  const std::array<std::pair<std::string, json>, 4> requests = {
      {{"/v1/jobs", {{"kind", "capture"}, {"rig", fifo}, {"output", output}}},
       {"/v1/jobs", {{"kind", "capture"}, {"rig", "/dev/zero"}, {"output", output}}},
       {"/v1/preview", {{"rig", fifo}}},
       {"/v1/jobs", {{"kind", "preview"}, {"rig", fifo}, {"output", output + ".jpg"}}}}};
  Crowd crowd;
  for (std::size_t k = 0; k < 200; ++k) {
    const auto& [path, body] = requests[k % requests.size()];
    crowd.push_back(std::make_unique<RawClient>(socket));
    crowd.back()->Send(HttpRequest("POST", path, body.dump()));
  }
  const TimedAnswer off = TimedExchange(socket, HttpRequest("POST", "/v1/lights/off"));
  EXPECT_THAT(off.text, HasSubstr("/nowhere/tty"));  // there is no board to be asked
  EXPECT_LT(off.time, kSoon);
  const auto start = std::chrono::steady_clock::now();
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - start, kSoon);
  EXPECT_FALSE(std::filesystem::exists(socket));
}

// A reader that goes away is an error, not the end by a signal.
TEST(DaemonProgram, AClosedPipeIsAnErrorOfWriting) {
  const TempFolder folder;
  const std::string pipe = "'" + folder.Path().string() + "/pipe'";
  // A named pipe whose only reader, the shell itself, has closed it before the program begins.
  const ShellResult closed =
      Shell("cd '" + SourceDir() + "' && mkfifo " + pipe + " && exec 3<>" + pipe + " 4>" + pipe +
            " 3>&- && '" + kSateen + "' simulate --list >&4; echo status $?");
  EXPECT_THAT(closed.out, HasSubstr("standard output cannot be written"));
  EXPECT_THAT(closed.out, HasSubstr("status 4"));
}

}  // namespace
}  // namespace sateen::testing::daemon_program_test
