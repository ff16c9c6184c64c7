#pragma once

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/testing/places.h"

// The programs as people start them: sateen-virtual-rig with the firmware, and under it sateen.
// These run in real time; nothing depends on how fast the machine is.
namespace sateen::testing {

using nlohmann::json;

inline const std::string kRig = testing::ProgramDir() + "/sateen-virtual-rig";
inline const std::string kSateen = testing::ProgramDir() + "/sateen";
inline const std::string kRing = testing::SourceDir() + "/samples/rigs/ring10.json";

struct ShellResult {
  int exit_status = -1;
  std::string out;  // and what went to standard error
};

inline std::FILE* StartShell(const std::string& command) {
  return popen(("exec 2>&1; " + command).c_str(), "r");
}

// Reads to the end, so that the command does not find its pipe closed.
inline ShellResult EndShell(std::FILE* pipe) {
  ShellResult result;
  std::array<char, 4096> bytes = {};
  for (size_t count = 0; (count = std::fread(bytes.data(), 1, bytes.size(), pipe)) > 0;) {
    result.out.append(bytes.data(), count);
  }
  const int status = pclose(pipe);
  result.exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return result;
}

inline std::vector<json> Events(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<json> events;
  for (std::string line; std::getline(file, line) && !file.eof();) {
    events.push_back(json::parse(line));
  }
  return events;
}

inline ShellResult Shell(const std::string& command) { return EndShell(StartShell(command)); }

// A rig that runs by itself, told what to do by lines on its standard input.
class RunningRig {
 public:
  explicit RunningRig(const std::filesystem::path& folder,
                      const std::string& options = "--rig '" + kRing + "'")
      : events_(folder / "events.jsonl"), log_(folder / "log") {
    const std::string command = "exec '" + kRig + "' " + options + " --events '" +
                                events_.string() + "' --port-link '" + (folder / "port").string() +
                                "' 2>'" + log_.string() + "'";
    input_ = popen(command.c_str(), "w");
    start_ = WaitFor("start");
  }
  RunningRig(const RunningRig&) = delete;
  RunningRig& operator=(const RunningRig&) = delete;
  ~RunningRig() {
    Tell("quit");
    EXPECT_EQ(pclose(input_), 0);
  }

  void Tell(const std::string& line) {
    std::fputs((line + "\n").c_str(), input_);
    std::fflush(input_);
  }

  // The `number`th such event; waits for it, but not for ever.
  json WaitFor(const std::string& what, int number = 1) {
    for (int i = 0; i < 3000; ++i) {
      int seen = 0;
      for (const json& event : Events(events_)) {
        if (event["event"] == what && ++seen == number) {
          return event;
        }
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ADD_FAILURE() << "no event '" << what << "'";
    return {};
  }

  // Returns the rig's standard error once `words` is in it; does not wait for ever.
  std::string WaitForError(const std::string& words) {
    for (int i = 0; i < 3000; ++i) {
      std::ifstream file(log_);
      const std::string text{std::istreambuf_iterator<char>(file), {}};
      if (text.find(words) != std::string::npos) {
        return text;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ADD_FAILURE() << "no word of '" << words << "'";
    return "";
  }

  [[nodiscard]] std::string Variable(const std::string& name) const {
    return start_["environment"][name].get<std::string>();
  }
  // Before a command that shall find the board, and the camera where there is one.
  [[nodiscard]] std::string Environment() const {
    std::string environment;
    for (const auto& [name, value] : start_["environment"].items()) {
      environment += name + "='" + value.get<std::string>() + "' ";
    }
    return environment;
  }

 private:
  std::filesystem::path events_;
  std::filesystem::path log_;
  std::FILE* input_ = nullptr;
  json start_;
};

}  // namespace sateen::testing
