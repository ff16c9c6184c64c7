#pragma once

#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "simulation/virtual_rig/board/light_log.h"
#include "simulation/virtual_rig/board/virtual_board.h"
#include "simulation/virtual_rig/rig_action.h"
#include "simulation/virtual_rig/virtual_port.h"

namespace sateen {

struct RigLoopOptions {
  // Names of the lights by channel, for the events; a channel without one is "channel 7".
  std::vector<std::string> names;
  // Whether opening the port resets the board, as it does an Uno, whose boot loader takes 1 s.
  bool opening_resets = false;
  // Where events go, one JSON object a line; nowhere if null.
  std::FILE* events = nullptr;
  // Log that is told by the wall clock what the lights do; null: none.
  LightLog* light_log = nullptr;
};

// Commands that RigLoop::Parse() understands, for people.
inline constexpr std::string_view kBoardCommands =
    "reset, unplug, plug, brown-out [MS], flash [MS]";

// Runs the virtual board in real time with its serial line on a virtual port, and writes down what
// happens to its lights. Simulated time follows the wall clock at 1.00x: the board runs up to now,
// what it sent goes to the host, and the loop waits until the host sends something or 100 us have
// passed. When the machine keeps it from running for longer than 100 ms, that time is left out.
//
// Events, each with "time_s", simulated: "start" {port, terminal, firmware, lights, environment},
// "light" {channel, name, level}, "shutter" {closed}, "reset" {cause}, "plug", "unplug", "end"
// {wall_s, longest_lag_s}; of a camera "exposure" {number, exposure_s, f_number, iso, lit, bytes}
// and "scene" {folder, read}.
class RigLoop {
 public:
  RigLoop(VirtualBoard& board, VirtualPort& port, RigLoopOptions options);
  RigLoop(const RigLoop&) = delete;
  RigLoop& operator=(const RigLoop&) = delete;
  ~RigLoop() { board_.Unwatch(watch_); }

  // Environment in which a program finds the board; told in the first event.
  using Environment = std::map<std::string, std::string>;

  void Start(const std::string& firmware, const Environment& environment);
  // Waits for at most 100 us and lets the board catch up.
  void Step();
  void End();

  // A line of kBoardCommands; "flash" is the camera that closes its contact. Nothing where the verb
  // is none of these; kInvalidArgument for what does not fit it. By the thread that calls Step(),
  // as the action.
  [[nodiscard]] std::optional<Result<RigAction>> Parse(const std::string& line);

  // Writes down an event of now, the fields of its object without braces. By the same thread.
  void Say(const std::string& fields) const { Say(board_.Now(), fields); }

 private:
  [[nodiscard]] std::chrono::nanoseconds WallTime() const;
  // When it is, or was, `time` by the wall clock; of times since the machine last kept it from
  // running.
  [[nodiscard]] std::chrono::steady_clock::time_point WallClockAt(SimTime time) const;
  Status Act(const std::string& verb, SimTime time);
  void Say(SimTime time, const std::string& fields) const;

  VirtualBoard& board_;
  VirtualPort& port_;
  RigLoopOptions options_;
  int watch_ = 0;
  std::chrono::steady_clock::time_point start_;
  std::chrono::nanoseconds left_out_{};
  std::chrono::nanoseconds longest_lag_{};
  std::optional<SimTime> flash_ends_;
  bool was_in_use_ = false;
};

}  // namespace sateen
