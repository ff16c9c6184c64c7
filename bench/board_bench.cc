// Measures every bar of the LED board, its link and the virtual rig, anew with the real firmware,
// and prints the table. `board_bench --full` takes the numbers of the bars (minutes); without it,
// 2 %.
#include <fmt/format.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/files/file_io.h"
#include "core/interrupt.h"
#include "core/progress_bar.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/serial_port.h"
#include "simulation/virtual_rig/board/line_stress.h"
#include "simulation/virtual_rig/board/simulated_port.h"
#include "simulation/virtual_rig/board/virtual_board.h"

namespace {

using sateen::Fail;
using sateen::LightBoard;
using sateen::Result;
using sateen::SimTime;
using sateen::SimulatedPort;
using sateen::Status;
using sateen::VirtualBoard;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

const std::string kFirmware = SATEEN_FIRMWARE_DIR "/sateen-controller.elf";
const std::string kTestFirmware = SATEEN_FIRMWARE_DIR "/sateen-controller-test.elf";
const std::string kRig = SATEEN_PROGRAM_DIR "/sateen-virtual-rig";

double SecondsOf(SimTime time) { return std::chrono::duration<double>(time).count(); }

void Row(const std::string& what, const std::string& measured, const std::string& bar, bool met) {
  fmt::print("{:<46} {:<44} {:<16} {}\n", what, measured, bar, met ? "met" : "NOT MET");
  std::fflush(stdout);
}

// The other half of MeasureRoundTrips(), run under the virtual rig: prints one line per
// round trip, in microseconds.
int RoundTripHost(int count) {
  LightBoard host(sateen::MakeSerialPort(""));
  if (const Status connected = host.Connect(); !connected) {
    std::cerr << connected.error().message << '\n';
    return 5;
  }
  const int lights = static_cast<int>(host.Info().lights.size());
  for (int i = 0; i < count; ++i) {
    const auto start = steady_clock::now();
    const auto state = host.SetLight(i % lights, 0.5, milliseconds(1000));
    const auto took = std::chrono::duration<double, std::micro>(steady_clock::now() - start);
    if (!state) {
      std::cerr << state.error().message << '\n';
      return 5;
    }
    fmt::print("{:.1f}\n", took.count());
  }
  return 0;
}

// Measures through libserialport, the pseudo terminal and the paced simulator, as `sateen` would.
Status MeasureRoundTrips(const std::string& self, int count) {
  std::error_code no_folder;
  std::string events =
      (std::filesystem::temp_directory_path(no_folder) / "sateen-board-bench-XXXXXX").string();
  const int descriptor = mkstemp(events.data());
  if (descriptor < 0) {
    return Fail(sateen::ErrorCode::kIo, "no temporary file can be made");
  }
  close(descriptor);
  const std::string command = fmt::format("'{}' run --firmware '{}' --events {} -- '{}' --host {}",
                                          kRig, kFirmware, events, self, count);
  std::FILE* pipe = popen(command.c_str(), "r");
  std::vector<double> us;
  double value = 0;
  while (pipe != nullptr && std::fscanf(pipe, "%lf", &value) == 1) {
    us.push_back(value);
  }
  const int status = pipe == nullptr ? -1 : pclose(pipe);
  const Result<std::string> text = sateen::ReadFileBytes(events);
  std::remove(events.c_str());
  if (status != 0 || us.empty() || !text) {
    return Fail(sateen::ErrorCode::kDevice, "the virtual rig or its host failed: {}", command);
  }
  const size_t last = text->rfind("{\"time_s\"");
  const nlohmann::json end = nlohmann::json::parse(text->substr(last));
  const double pace = end.at("time_s").get<double>() / end.at("wall_s").get<double>();
  std::sort(us.begin(), us.end());
  const auto quantile = [&](double q) {
    return us[static_cast<size_t>(q * static_cast<double>(us.size() - 1))] / 1000;
  };
  Row(fmt::format("round trip of set light, {} times", us.size()),
      fmt::format("median {:.2f} ms, p90 {:.2f}, p99 {:.2f}, {:.2f}x", quantile(0.5), quantile(0.9),
                  quantile(0.99), pace),
      "<= 1.5 ms", quantile(0.5) <= 1.5);
  return {};
}

Result<std::unique_ptr<VirtualBoard>> Start(const std::string& firmware) {
  auto board = VirtualBoard::Load(firmware);
  if (board) {
    (*board)->RunFor(milliseconds(20));
  }
  return board;
}

Status MeasureBadLine(uint64_t commands, const sateen::Task& task) {
  auto board = Start(kFirmware);
  if (!board) {
    return tl::unexpected(board.error());
  }
  const auto start = steady_clock::now();
  const auto result = sateen::RunLineStress(**board, {.commands = commands}, task);
  task.ClearProgress();
  if (!result) {
    return tl::unexpected(result.error());
  }
  const auto& line = result->line;
  fmt::print(
      "  {} bytes on the line: {} dropped, {} flipped, {} inserted; {} done, {} reported failed;\n"
      "  slowest command {:.3f} s; {:.0f} s simulated in {:.0f} s\n",
      line.bytes, line.dropped, line.flipped, line.inserted, result->done, result->reported_failed,
      SecondsOf(result->longest_command), SecondsOf(result->simulated),
      std::chrono::duration<double>(steady_clock::now() - start).count());
  if (!result->first_wrong.empty()) {
    fmt::print("  first wrong: {}\n", result->first_wrong);
  }
  Row(fmt::format("{} messages over a bad line", commands),
      fmt::format("{} wrong lights, {} wrong answers, {} over time", result->wrong_light,
                  result->wrong_answer, result->over_time),
      "none",
      result->wrong_light + result->wrong_answer + result->over_time == 0 &&
          result->done + result->reported_failed == commands);
  return {};
}

Status MeasureRandomBytes(uint64_t count) {
  auto board = Start(kFirmware);
  if (!board) {
    return tl::unexpected(board.error());
  }
  std::mt19937_64 random(1);
  std::vector<uint8_t> bytes(500);
  for (uint64_t sent = 0; sent < count; sent += bytes.size()) {
    for (uint8_t& byte : bytes) {
      byte = static_cast<uint8_t>(random());
    }
    (*board)->Send(bytes);
    (*board)->RunUntil([&] { return (*board)->InnerChip().BytesUnderWay() == 0; },
                       std::chrono::seconds(1));
    (*board)->TakeSent();
  }
  int times_on = 0;
  for (const sateen::ChannelRecord& record : (*board)->Records()) {
    times_on += record.times_on;
  }
  LightBoard host(std::make_unique<SimulatedPort>(**board));
  const bool works = host.Connect() && host.SetLight(3, 0.5, milliseconds(100)) &&
                     (*board)->Lit() == std::vector<int>{3};
  Row(fmt::format("{} random bytes", count),
      fmt::format("lights on {} times; then it {}", times_on, works ? "works" : "does not work"),
      "0, works", times_on == 0 && works);
  return {};
}

// Measures how long the light is on after the host's last word.
Status MeasureSilence() {
  auto board = Start(kFirmware);
  if (!board) {
    return tl::unexpected(board.error());
  }
  LightBoard host(std::make_unique<SimulatedPort>(**board));
  if (!host.Connect() || !host.SetLight(9, 1.0, milliseconds(10'000))) {
    return Fail(sateen::ErrorCode::kDevice, "the light cannot be set");
  }
  const SimTime killed = (*board)->Now();
  (*board)->RunUntil([&] { return (*board)->Lit().empty(); }, std::chrono::seconds(10));
  const double off_s = SecondsOf((*board)->Now() - killed);
  Row("host killed with a light on", fmt::format("off after {:.3f} s", off_s), "<= 2.1 s",
      off_s <= 2.1);
  return {};
}

Status MeasureHang() {
  double worst_s = 0;
  std::string cause;
  for (const bool interrupts : {false, true}) {
    auto board = Start(kTestFirmware);
    if (!board) {
      return tl::unexpected(board.error());
    }
    LightBoard host(std::make_unique<SimulatedPort>(**board));
    if (!host.Connect() || !host.SetLight(9, 1.0, milliseconds(5000)) || !host.Hang(interrupts)) {
      return Fail(sateen::ErrorCode::kDevice, "the test firmware cannot be made to hang");
    }
    const SimTime hung = (*board)->Now();
    (*board)->RunUntil([&] { return (*board)->Lit().empty(); }, std::chrono::seconds(10));
    worst_s = std::max(worst_s, SecondsOf((*board)->Now() - hung));
    (*board)->RunFor(milliseconds(50));
    if (!host.Report() && host.Connect()) {
      cause = host.Info().reset_cause;
    }
  }
  Row("firmware hangs", fmt::format("off and reset after {:.3f} s; host: {}", worst_s, cause),
      "<= 0.3 s", worst_s <= 0.3 && cause.find("watchdog") != std::string::npos);
  return {};
}

// Unplugged at each of many moments of a command.
Status MeasureReplug() {
  auto board = Start(kFirmware);
  if (!board) {
    return tl::unexpected(board.error());
  }
  VirtualBoard& b = **board;
  LightBoard host(std::make_unique<SimulatedPort>(b));
  SimTime slowest{};
  int wrong = 0;
  int times = 0;
  for (int us = 0; us < 1500; us += 10, ++times) {
    if (!host.Connect() || !host.SetLight(1, 0.5, milliseconds(5000))) {
      return Fail(sateen::ErrorCode::kDevice, "no link after unplugging at {} us", us - 10);
    }
    b.At(b.Now() + microseconds(us), [&] { b.Unplug(); });
    static_cast<void>(host.SetLight(2, 0.5, milliseconds(5000)));
    b.RunFor(milliseconds(2));
    const SimTime plugged = b.Now() + milliseconds(300);
    b.At(plugged, [&] { b.Plug(); });
    wrong += host.Report() ? 1 : 0;
    wrong += host.Connect() ? 0 : 1;
    slowest = std::max(slowest, b.Now() - plugged);
    const auto report = host.Report();
    wrong += report && report->state.lit == 0 && b.Lit().empty() ? 0 : 1;
  }
  Row(fmt::format("unplugged and replugged, {} moments", times),
      fmt::format("back after {:.3f} s, {} wrong beliefs", SecondsOf(slowest), wrong), "<= 1 s, 0",
      SecondsOf(slowest) <= 1 && wrong == 0);
  return {};
}

Status MeasureSize() {
  std::FILE* pipe = popen(("avr-size '" + kFirmware + "'").c_str(), "r");
  std::array<char, 256> line = {};
  int text = 0;
  int data = 0;
  int bss = 0;
  bool read = pipe != nullptr && std::fgets(line.data(), line.size(), pipe) != nullptr &&
              std::fscanf(pipe, "%d %d %d", &text, &data, &bss) == 3;
  if (pipe != nullptr) {
    read = pclose(pipe) == 0 && read;
  }
  if (!read) {
    return Fail(sateen::ErrorCode::kIo, "avr-size does not tell the size of {}", kFirmware);
  }
  Row("firmware size", fmt::format("{} bytes of flash, {} of RAM", text + data, data + bss),
      "8192, 1024", text + data <= 8192 && data + bss <= 1024);
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The LED board and its link against their bars, with the real firmware");
  bool full = false;
  int host = 0;
  int round_trips = 1000;
  app.add_flag("--full", full, "A million messages and a million bytes");
  app.add_option("--round-trips", round_trips, "How many are timed")->capture_default_str();
  app.add_option("--host", host, "For its own use")->group("");
  CLI11_PARSE(app, argc, argv);
  if (host > 0) {
    return RoundTripHost(host);
  }
  sateen::InstallInterruptHandlers();
  sateen::ProgressBar progress(2);
  const sateen::Task task{.progress = &progress, .cancel = &sateen::InterruptFlag()};
  const uint64_t many = full ? 1'000'000 : 20'000;
  const std::string self = std::filesystem::read_symlink("/proc/self/exe").string();
  fmt::print("{:<46} {:<44} {:<16} {}\n", "what", "measured", "bar", "");
  for (const auto& measure : std::vector<std::function<Status()>>{
           [&] { return MeasureRoundTrips(self, round_trips); }, MeasureSilence, MeasureHang,
           MeasureReplug, MeasureSize, [&] { return MeasureRandomBytes(many); },
           [&] { return MeasureBadLine(many, task); }}) {
    if (const Status measured = measure(); !measured) {
      std::cerr << "board_bench: error: " << measured.error().message << '\n';
      return ExitStatus(measured.error());
    }
  }
  return 0;
}
