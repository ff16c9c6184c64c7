#pragma once

#include <chrono>
#include <string>

#include "core/error.h"
#include "firmware/protocol/codec.h"
#include "scanner/devices/light_board.h"

namespace sateen {

// The one place where what a board says is compared with what it was asked. A frame whose CRC is
// right may still hold what cannot be: firmware of somebody else, a broken controller, a switch
// that sticks. Nobody is told that a light is off, on alone or at a level unless the board said so.

// Fails with kDevice unless each field of the greeting is in the range of docs/protocol.md.
[[nodiscard]] Status CheckGreeting(const SateenGreeting& said, const std::string& port);

// The circumstances of an answer.
struct BoardAsked {
  const BoardInfo& board;
  // Time from sending the command to its answer. A light that was asked for less may be off again.
  std::chrono::microseconds took{0};
};

// Each returns what the state contradicts the command or the board's own greeting by, in the words
// "says that ..."; empty where it fits.
[[nodiscard]] std::string Contradiction(const SateenSetLight& command, const SateenState& said,
                                        const BoardAsked& asked);
[[nodiscard]] std::string Contradiction(const SateenAllOff& command, const SateenState& said,
                                        const BoardAsked& asked);
[[nodiscard]] std::string Contradiction(const SateenStatus& command, const SateenState& said,
                                        const BoardAsked& asked);
[[nodiscard]] std::string Contradiction(const SateenArm& command, const SateenState& said,
                                        const BoardAsked& asked);
[[nodiscard]] std::string Contradiction(const SateenTriggerShutter& command,
                                        const SateenState& said, const BoardAsked& asked);
[[nodiscard]] std::string Contradiction(const SateenLimitLight& command, const SateenState& said,
                                        const BoardAsked& asked);
[[nodiscard]] std::string Contradiction(const SateenConfigure& command, const SateenState& said,
                                        const BoardAsked& asked);
[[nodiscard]] std::string Contradiction(const SateenClearFault& command, const SateenState& said,
                                        const BoardAsked& asked);
[[nodiscard]] std::string Contradiction(const SateenHang& command, const SateenState& said,
                                        const BoardAsked& asked);

}  // namespace sateen
