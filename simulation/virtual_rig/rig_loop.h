#pragma once

#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "simulation/virtual_rig/virtual_board.h"
#include "simulation/virtual_rig/virtual_port.h"

namespace sateen {

struct RigLoopOptions {
  // Names of the lights by channel, for the events; a channel without one is "channel 7".
  std::vector<std::string> names;
  // Whether opening the port resets the board, as it does an Uno, whose boot loader takes 1 s.
  bool opening_resets = false;
  // Where events go, one JSON object a line; nowhere if null.
  std::FILE* events = nullptr;
};

// Runs the virtual board in real time with its serial line on a virtual port, and writes down what
// happens to its lights. Simulated time follows the wall clock at 1.00x: the board runs up to now,
// what it sent goes to the host, and the loop waits until the host sends something or 100 us have
// passed. When the machine keeps it from running for longer than 100 ms, that time is left out.
//
// Events, each with "time_s", simulated: "start" {port, terminal, firmware, lights,
// environment}, "light"
// {channel, name, level}, "shutter" {closed}, "reset" {cause}, "plug", "unplug", "end" {wall_s}.
class RigLoop {
 public:
  RigLoop(VirtualBoard& board, VirtualPort& port, RigLoopOptions options);
  RigLoop(const RigLoop&) = delete;
  RigLoop& operator=(const RigLoop&) = delete;
  ~RigLoop() { board_.Unwatch(watch_); }

  // What a program is started with that shall find the board; told in the first event.
  using Environment = std::map<std::string, std::string>;

  void Start(const std::string& firmware, const Environment& environment);
  // Waits for at most 100 us and lets the board catch up.
  void Step();
  void End();

  // "reset", "unplug", "plug", "brown-out [MS]" or "flash [MS]" (the camera closes its contact).
  // kInvalidArgument for any other line.
  Status Command(const std::string& line);

 private:
  [[nodiscard]] std::chrono::nanoseconds WallTime() const;
  void Say(SimTime time, const std::string& fields) const;

  VirtualBoard& board_;
  VirtualPort& port_;
  RigLoopOptions options_;
  int watch_ = 0;
  std::chrono::steady_clock::time_point start_;
  std::chrono::nanoseconds left_out_{};
  std::optional<SimTime> flash_ends_;
  bool was_in_use_ = false;
};

}  // namespace sateen
