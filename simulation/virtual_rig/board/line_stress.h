#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "simulation/virtual_rig/board/simulated_port.h"
#include "simulation/virtual_rig/board/virtual_board.h"

namespace sateen {

struct LineStressOptions {
  uint64_t commands = 10'000;
  LineFaults faults = {.drop = 1e-3, .flip = 1e-3, .insert = 1e-3};
  // Seed of the choice of commands; the line has its own in `faults`.
  uint64_t seed = 1;
};

struct LineStressResult {
  uint64_t commands = 0;
  uint64_t done = 0;
  uint64_t reported_failed = 0;
  uint64_t reconnects = 0;
  // Counts that must be 0. wrong_light: a light went on that the command under way did not ask for,
  // or at another level. wrong_answer: a command was reported done and the lights were not as its
  // answer said, or not as it had asked.
  uint64_t wrong_light = 0;
  uint64_t wrong_answer = 0;
  uint64_t over_time = 0;  // lights that were on for longer than the limit
  std::string first_wrong;
  SimulatedPort::Counts line;
  uint64_t bad_frames = 0;  // received by the board since it last started
  uint64_t repeats = 0;
  SimTime longest_command{};
  SimTime simulated{};
};

/// Runs LightBoard and the real firmware at the two ends of a line that loses, flips and invents
/// bytes. Sends random commands one after the other: six in ten set a light, two turn all off, two
/// ask for a report. After a command that was reported failed the host connects again. The virtual
/// board is the witness of what really shone.
///
/// Errors  kDevice, kTimeout: the host cannot connect at all; kCancelled
/// Cost    about 0.3 ms of one core for each command
[[nodiscard]] Result<LineStressResult> RunLineStress(VirtualBoard& board,
                                                     const LineStressOptions& options,
                                                     const Task& task = {});

}  // namespace sateen
