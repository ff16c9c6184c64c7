// Measures every bar that captures must meet, anew on the virtual rig, and prints the table: the
// board's real firmware, real libserialport, libgphoto2 and LibRaw. `capture_bench --full` takes
// the numbers of the bars (half an hour); without it, a few of each.
#include <fmt/format.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/files/file_io.h"
#include "core/files/own_folder.h"
#include "scanner/capture/capture_request.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using sateen::Result;

const std::string kRigProgram = SATEEN_PROGRAM_DIR "/sateen-virtual-rig";
const std::string kSateen = SATEEN_PROGRAM_DIR "/sateen";

bool all_met = true;

void Row(const std::string& what, const std::string& measured, const std::string& bar, bool met) {
  all_met = all_met && met;
  fmt::print("{:<46} {:<60} {:<22} {}\n", what, measured, bar, met ? "met" : "NOT MET");
  std::fflush(stdout);
}

struct Outcome {
  int status = -1;
  std::string text;
};

Outcome Shell(const std::string& command) {
  Outcome outcome;
  std::FILE* pipe = popen(("exec 2>&1; " + command).c_str(), "r");
  std::array<char, 4096> bytes = {};
  for (size_t count = 0; (count = std::fread(bytes.data(), 1, bytes.size(), pipe)) > 0;) {
    outcome.text.append(bytes.data(), count);
  }
  const int status = pclose(pipe);
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

std::vector<json> EventsIn(const fs::path& file) {
  std::ifstream in(file);
  std::vector<json> events;
  for (std::string line; std::getline(in, line);) {
    events.push_back(json::parse(line, nullptr, /*allow_exceptions=*/false));
  }
  return events;
}

// Returns the longest time, in seconds, that a light stayed on after `since`, by the pins of the
// board.
double LitAfter(const std::vector<json>& events, double since_s) {
  double last_off = since_s;
  for (const json& event : events) {
    if (event.value("event", "") == "light" && event["level"] == 0.0) {
      last_off = std::max(last_off, event["time_s"].get<double>());
    }
  }
  return last_off - since_s;
}

bool AllOff(const std::vector<json>& events) {
  std::vector<double> level(16, 0.0);
  for (const json& event : events) {
    if (event.value("event", "") == "light") {
      level[event["channel"].get<size_t>()] = event["level"];
    }
  }
  return std::ranges::all_of(level, [](double l) { return l == 0.0; });
}

// A scene rendered, captures of it, and what the rig saw of them.
class CaptureBench {
 public:
  explicit CaptureBench(const fs::path& folder) : folder_(folder) {}

  // Renders a scene; false if it cannot be rendered.
  bool Render(const std::string& scene_file, const std::string& name) {
    const Outcome rendered = Shell(fmt::format("'{}' simulate '{}' --linear -o '{}'", kSateen,
                                               scene_file, (folder_ / name).string()));
    if (rendered.status != 0) {
      std::cerr << rendered.text;
    }
    scene_ = folder_ / name;
    // Its lights count as calibrated.
    json rig = json::parse(std::ifstream(scene_ / "rig.json"));
    rig["calibration"]["lights"] = json::object();
    std::ofstream(RigFile()) << rig.dump(1);
    return rendered.status == 0;
  }
  [[nodiscard]] fs::path RigFile() const { return folder_ / "rig.json"; }
  [[nodiscard]] fs::path Session(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] fs::path EventFile() const { return folder_ / "events.jsonl"; }

  // Runs a command under the rig; rig_options as "--at '5:camera busy'".
  [[nodiscard]] Outcome OnRig(const std::string& rig_options, const std::string& command) const {
    return Shell(fmt::format("HOME='{}' '{}' run --scene '{}' --events '{}' {} -- {}",
                             folder_.string(), kRigProgram, scene_.string(), EventFile().string(),
                             rig_options, command));
  }
  [[nodiscard]] std::string Capture(const std::string& name, const std::string& options) const {
    return fmt::format("'{}' capture --rig '{}' -o '{}' --deadline 6s {}", kSateen,
                       RigFile().string(), Session(name).string(), options);
  }
  [[nodiscard]] std::string Resume(const std::string& name) const {
    return fmt::format("'{}' capture --resume '{}' --deadline 6s", kSateen, Session(name).string());
  }
  // Goes on with a session; begins anew only where the program says that nothing was captured yet.
  [[nodiscard]] Outcome ResumeOrBegin(const std::string& name) const {
    Outcome resumed = OnRig("", Resume(name));
    if (resumed.status != 0 && resumed.text.find("nothing was captured") != std::string::npos) {
      resumed = OnRig("", Capture(name, ""));
    }
    return resumed;
  }
  [[nodiscard]] bool Verifies(const std::string& name) const {
    return Shell(fmt::format("'{}' session verify '{}'", kSateen, Session(name).string())).status ==
           0;
  }
  // Compares frame for frame.
  [[nodiscard]] bool Same(const std::string& name, const std::string& other) const {
    return Shell(fmt::format("diff -r '{}/frames' '{}/frames'", Session(name).string(),
                             Session(other).string()))
               .status == 0;
  }
  void Remove(const std::string& name) const { fs::remove_all(Session(name)); }

 private:
  fs::path folder_;
  fs::path scene_;
};

// Measures whole sessions of 16 megapixels.
void MeasureSpeed(CaptureBench& bench, const fs::path& source, int sessions) {
  if (!bench.Render((source / "samples/scenes/twill-d5100.json").string(), "large")) {
    return;
  }
  std::vector<double> seconds;
  std::vector<double> overhead_ms;
  for (int k = 0; k < sessions; ++k) {
    const Outcome run =
        bench.OnRig("", bench.Capture("speed", "--exposure 1/50 --json 2>/dev/null"));
    const json report = json::parse(run.text, nullptr, /*allow_exceptions=*/false);
    if (run.status != 0 || report.is_discarded()) {
      std::cerr << run.text;
      return;
    }
    seconds.push_back(report["seconds"]);
    overhead_ms.push_back(1000.0 * (seconds.back() - report["camera_seconds"].get<double>()) /
                          report["frames"].get<double>());
    bench.Remove("speed");
  }
  std::ranges::sort(seconds);
  std::ranges::sort(overhead_ms);
  Row("session of 13 frames, 16 megapixels",
      fmt::format("{:.1f} s, best of {} {:.1f} s", seconds[seconds.size() / 2], sessions,
                  seconds[0]),
      "12 s", seconds[seconds.size() / 2] <= 12.0);
  Row("all but exposing and delivering, a frame",
      fmt::format("{:.0f} ms, decoding and the last checks with it", overhead_ms[sessions / 2]),
      "100 ms", overhead_ms[overhead_ms.size() / 2] <= 100.0);
}

// kill -9 at moments spread over a capture, then --resume.
void MeasureKills(CaptureBench& bench, int kills) {
  const Outcome whole = bench.OnRig("", bench.Capture("whole", "--json"));
  // From its start on, opening the devices included; at its end it may be done before it is killed.
  const double seconds = json::parse(whole.text, nullptr, false).value("seconds", 0.0) + 0.3;
  const int moments = kills + kills / 10;
  int killed = 0;
  int completed = 0;
  int same = 0;
  double longest_lit = 0.0;
  for (int k = 0; k < moments; ++k) {
    const double at_s = seconds * (k + 0.5) / moments;
    const Outcome cut = bench.OnRig(
        "",
        fmt::format("sh -c \"timeout -s KILL {:.3f} {} >/dev/null; s=\\$?; sleep 2.5; exit \\$s\"",
                    at_s, bench.Capture("cut", "")));
    killed += cut.status == 137 ? 1 : 0;
    const std::vector<json> events = EventsIn(bench.EventFile());
    longest_lit = std::max(longest_lit, AllOff(events) ? LitAfter(events, at_s) : 1e9);
    const Outcome resumed = bench.ResumeOrBegin("cut");
    completed += resumed.status == 0 && bench.Verifies("cut") ? 1 : 0;
    same += bench.Same("cut", "whole") ? 1 : 0;
    if (resumed.status != 0) {
      fmt::print("  killed at {:.3f} s: {}\n", at_s, resumed.text);
    }
    bench.Remove("cut");
  }
  bench.Remove("whole");
  Row(fmt::format("kill -9 at {} moments", moments),
      fmt::format("{} killed, {} resumed and verified, {} the same", killed, completed, same),
      fmt::format("{} killed, all resume", kills),
      killed >= kills && completed == moments && same == moments);
  Row("a light after kill -9", fmt::format("on for {:.2f} s at most", longest_lit), "2.1 s",
      longest_lit <= 2.1);
}

struct Fault {
  const char* commands;  // commands to the rig at one capture; ';' separates several
};

constexpr std::array kFaults = {Fault{"camera busy"},
                                Fault{"camera busy 3"},
                                Fault{"camera no-event"},
                                Fault{"camera late-event"},
                                Fault{"camera gone"},
                                Fault{"camera dropped-mid-file"},
                                Fault{"camera short-transfer"},
                                Fault{"camera truncated-file"},
                                Fault{"camera card-full"},
                                Fault{"camera asleep"},
                                Fault{"camera wrong-exposure"},
                                Fault{"camera two-files"},
                                Fault{"reset"},
                                Fault{"brown-out 50"},
                                Fault{"unplug"},
                                Fault{"unplug;plug"},
                                Fault{"light 4 0"},
                                Fault{"light 4 0.8"},
                                Fault{"swap 2 7"},
                                Fault{"double 4 5"},
                                Fault{"ambient 30"},
                                Fault{"nudge 3 0"},
                                Fault{"shade 80 60 40 0.3 1"}};
struct Phase {
  const char* name;
  int capture;
  const char* options;
};
constexpr std::array kPhases = {
    Phase{"test frame", 1, ""}, Phase{"first dark", 1, "--exposure 1/50"},
    Phase{"led-4", 6, "--exposure 1/50"}, Phase{"repeat", 12, "--exposure 1/50"},
    Phase{"last dark", 13, "--exposure 1/50"}};

std::string AtOptions(const Fault& fault, int capture) {
  std::string options;
  std::string rest = fault.commands;
  int after_ms = 0;
  while (!rest.empty()) {
    const size_t end = std::min(rest.find(';'), rest.size());
    options += fmt::format("--at '{}+{}ms:{}' ", capture, after_ms, rest.substr(0, end));
    rest.erase(0, end + 1);
    after_ms += 300;
  }
  return options;
}

// Completes and verifies; or stops with status 3 or 5 and words that name frame or device, and then
// resumes on a mended rig. Lights off by then either way.
void MeasureFaults(CaptureBench& bench, size_t stride) {
  int tried = 0;
  int completed = 0;
  int stopped = 0;
  std::vector<std::string> wrong;
  for (size_t k = 0; k < kFaults.size() * kPhases.size(); k += stride) {
    const Fault& fault = kFaults[k / kPhases.size()];
    const Phase& phase = kPhases[k % kPhases.size()];
    const std::string what = fmt::format("{} at {}", fault.commands, phase.name);
    ++tried;
    const Outcome run = bench.OnRig(AtOptions(fault, phase.capture),
                                    "timeout -k 5 90 " + bench.Capture("faulty", phase.options));
    const std::vector<json> events = EventsIn(bench.EventFile());
    if (!AllOff(events)) {
      wrong.push_back(what + ": a light was left on");
    }
    if (run.status == 0) {
      ++completed;
    } else if ((run.status == 3 || run.status == 5) &&
               run.text.find("error: ") != std::string::npos) {
      ++stopped;
      const Outcome resumed = bench.ResumeOrBegin("faulty");
      if (resumed.status != 0) {
        wrong.push_back(what + ": does not resume: " + resumed.text);
      }
    } else {
      wrong.push_back(fmt::format("{}: status {}: {}", what, run.status, run.text));
    }
    if (!bench.Verifies("faulty")) {
      wrong.push_back(what + ": does not verify");
    }
    fmt::print("  {:<40} {} {}\n", what, run.status,
               run.status == 0 ? "" : run.text.substr(0, run.text.find('\n')));
    std::fflush(stdout);
    bench.Remove("faulty");
  }
  for (const std::string& text : wrong) {
    fmt::print("  WRONG: {}\n", text);
  }
  Row(fmt::format("{} faults", tried),
      fmt::format("{} completed, {} stopped and resumed, {} wrong", completed, stopped,
                  wrong.size()),
      "none wrong", wrong.empty());
}

// The other half of MeasureRepeats(), run under the rig: one session after another in one
// process.
int RepeatHost(const fs::path& rig, const fs::path& out, int sessions) {
  const char* camera = std::getenv("SATEEN_CAMERA");  // the virtual rig's
  sateen::RigDevices devices({.camera = camera != nullptr ? camera : ""});
  for (int k = 0; k < sessions; ++k) {
    sateen::CaptureRequest request{.rig = rig, .output = out / "repeated"};
    request.options.exposure_s = 0.02;
    const auto summary = sateen::RunCapture(request, devices, {});
    if (!summary) {
      std::cerr << summary.error().message << '\n';
      return 5;
    }
    fs::remove_all(request.output);
    std::ifstream status("/proc/self/status");
    int kib = 0;
    for (std::string word; status >> word;) {
      if (word == "VmRSS:") {
        status >> kib;
      }
    }
    const auto descriptors = std::distance(fs::directory_iterator("/proc/self/fd"), {});
    fmt::print("{} {}\n", kib, descriptors);
    std::fflush(stdout);
  }
  return 0;
}

void MeasureRepeats(const CaptureBench& bench, const fs::path& self, const fs::path& folder,
                    int sessions) {
  const Outcome run =
      bench.OnRig("", fmt::format("'{}' --repeat-host {} --rig '{}' --folder '{}'", self.string(),
                                  sessions, bench.RigFile().string(), folder.string()));
  std::istringstream in(run.text);
  std::vector<std::pair<double, int>> states;
  double kib = 0.0;
  for (int descriptors = 0; in >> kib >> descriptors;) {
    states.emplace_back(kib, descriptors);
  }
  if (run.status != 0 || states.size() != static_cast<size_t>(sessions)) {
    std::cerr << run.text;
    Row(fmt::format("{} sessions in a row", sessions), "did not run", "flat", false);
    return;
  }
  const auto& early = states[states.size() / 5];
  const auto& last = states.back();
  Row(fmt::format("{} sessions in a row", sessions),
      fmt::format("memory {:.1f} -> {:.1f} MB, descriptors {} -> {}", early.first / 1024.0,
                  last.first / 1024.0, early.second, last.second),
      "flat", last.first < 1.02 * early.first + 1024.0 && last.second == early.second);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("What captures must show, measured on the virtual rig", "capture_bench");
  bool full = false;
  int repeat_host = 0;
  std::string rig;
  std::string only;
  fs::path folder;
  app.add_flag("--full", full, "The numbers of the bars; half an hour");
  app.add_option("--only", only, "speed, kill, faults or repeat");
  app.add_option("--repeat-host", repeat_host, "Used by itself")->group("");
  app.add_option("--rig", rig, "Used by itself")->group("");
  app.add_option("--folder", folder, "Used by itself")->group("");
  CLI11_PARSE(app, argc, argv);
  if (repeat_host > 0) {
    return RepeatHost(rig, folder, repeat_host);
  }
  const sateen::Result<sateen::OwnFolder> scratch = sateen::MakeScratchFolder("capture-bench");
  if (!scratch) {
    std::cerr << "capture_bench: error: " << scratch.error().message << '\n';
    return 4;
  }
  const fs::path source = SATEEN_SOURCE_DIR;
  CaptureBench bench(scratch->Path());
  if (!bench.Render((source / "samples/scenes/twill-table.json").string(), "small")) {
    std::cerr << "capture_bench: error: cannot render into " << scratch->Path() << '\n';
    return 4;
  }
  const auto wanted = [&](const char* name) { return only.empty() || only == name; };
  if (wanted("kill")) {
    MeasureKills(bench, full ? 60 : 4);
  }
  if (wanted("faults")) {
    MeasureFaults(bench, full ? 1 : 13);
  }
  if (wanted("repeat")) {
    MeasureRepeats(bench, fs::canonical("/proc/self/exe"), scratch->Path(), full ? 100 : 5);
  }
  if (wanted("speed")) {
    MeasureSpeed(bench, source, full ? 5 : 1);
  }
  return all_met ? 0 : 3;
}
