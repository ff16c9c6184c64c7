#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/devices/light_board.h"

namespace sateen {

// A board's description of itself.
struct BoardWord {
  std::string port;
  BoardInfo info;
  BoardReport report;
};

// Changes to a board's settings. Absent ones stay. Any change turns all lights off.
struct BoardChange {
  bool clear_fault = false;
  std::optional<int> channel;  // channel for max_level and max_on; absent: all
  std::optional<double> max_level;
  std::optional<std::chrono::milliseconds> max_on;
  std::optional<int> max_lit;
  std::optional<int> dim_clock;
  std::optional<bool> sync_rising;
};

/// Makes the changes, one after the other, and asks the board.
///
/// Errors  kInvalidArgument: the board has no such channel, and nothing was changed; as LightBoard:
///         what was changed before the error stays changed
[[nodiscard]] Result<BoardWord> ChangeBoard(const BoardChange& change, LightBoard& board);

}  // namespace sateen
