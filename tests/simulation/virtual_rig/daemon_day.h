#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/simulation/virtual_rig/daemon_stress.h"

// A day of the daemon: sessions one after the other, with everything that goes with them, and what
// the process uses meanwhile.
namespace sateen::testing {

struct Usage {
  long memory_kb = 0;
  long descriptors = 0;
  long threads = 0;
  long scratch_files = 0;  // in the folder for temporary files
};

inline long EntriesOf(const std::filesystem::path& folder) {
  std::error_code ignored;
  const std::filesystem::directory_iterator entries(folder, ignored);
  return std::distance(begin(entries), end(entries));
}

inline Usage UsageNow(const StressedDaemon& daemon) {
  Usage usage = {.descriptors = EntriesOf("/proc/self/fd"),
                 .threads = EntriesOf("/proc/self/task"),
                 .scratch_files = EntriesOf(daemon.scratch.Path())};
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    if (word == "VmRSS:") {
      status >> usage.memory_kb;
    }
  }
  return usage;
}

// The clients of one session: who looks at the state and the devices, takes a preview, turns a
// light on and all off, captures, follows, solves, and asks for what is not there.
class DaemonDay {
 public:
  explicit DaemonDay(StressedDaemon& daemon) : daemon_(daemon) {}

  // Returns what went wrong; empty where everything went right. The solve takes most of the time.
  std::vector<std::string> LiveOneSession(bool solve = true) {
    wrong_.clear();
    const std::filesystem::path dir = daemon_.folder.Path() / fmt::format("session-{}", sessions_);
    const std::filesystem::path maps = daemon_.folder.Path() / fmt::format("maps-{}", sessions_++);
    const std::string rig = daemon_.rig_file.string();
    Expect("GET", "/v1/state", nullptr, 200);
    Expect("GET", "/v1/devices", nullptr, 200);
    Expect("POST", "/v1/preview", {{"rig", rig}, {"exposure_s", 0.02}, {"max_width", 16}}, 200);
    RunJob("/v1/lights/3", {{"level", 0.5}, {"for_ms", 50}});
    Expect("POST", "/v1/lights/off", nullptr, 200);
    RunJob("/v1/jobs", {{"kind", "capture"}, {"rig", rig}, {"output", dir.string()}});
    if (solve) {
      RunJob("/v1/jobs", {{"kind", "solve"},
                          {"capture", dir.string()},
                          {"output", maps.string()},
                          {"threads", 1}});
    }
    Expect("POST", "/v1/jobs", {{"kind", "solve"}}, 400);
    Expect("GET", "/v1/jobs", nullptr, 200);
    std::filesystem::remove_all(dir);
    std::filesystem::remove_all(maps);
    return wrong_;
  }

 private:
  std::string Expect(const std::string& method, const std::string& path, const nlohmann::json& body,
                     int status) {
    std::string answer = Exchange(
        daemon_.socket, HttpRequest(method, path, body.is_null() ? std::string() : body.dump()));
    if (StatusOf(answer) != status) {
      wrong_.push_back(fmt::format("{} {}: {}", method, path, answer.substr(0, 400)));
    }
    return answer;
  }

  void RunJob(const std::string& path, const nlohmann::json& body) {
    const nlohmann::json begun = nlohmann::json::parse(BodyOf(Expect("POST", path, body, 202)),
                                                       nullptr, /*allow_exceptions=*/false);
    if (!begun.is_object() || !begun.contains("events")) {
      return;
    }
    const std::string events = Expect("GET", begun["events"], nullptr, 200);
    if (events.find("event: done") == std::string::npos) {
      wrong_.push_back(fmt::format("{}: {}", path, events.substr(0, 1000)));
    }
  }

  StressedDaemon& daemon_;
  int sessions_ = 0;
  std::vector<std::string> wrong_;
};

}  // namespace sateen::testing
