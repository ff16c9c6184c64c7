#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "scanner/devices/board_link.h"
#include "simulation/virtual_rig/board/simulated_port.h"
#include "tests/simulation/virtual_rig/board_talk.h"

// A board that does as it is told, and says something else: the real firmware, whose answers are
// changed on their way to the host.
namespace sateen::testing {

// One way to lie.
struct Lie {
  std::string name;
  std::function<void(SateenGreeting&)> greeting = {};
  // Changes the state in an answer to a command; a report begins with one, too.
  std::function<void(SateenState&)> state = {};
  int request = -1;      // message that is answered so; -1: any
  int honest = 0;        // so many of those answers come unchanged first
  bool swallow = false;  // they do not come at all
};

// Counts of what the host was told; a Lie changes no more than one of them.
struct Told {
  int lies = 0;     // answers that were changed or swallowed
  int all_off = 0;  // answers to all off
  std::optional<SateenState> last;
};

class LyingPort : public SimulatedPort {
 public:
  // `board` and `told` outlive the port.
  LyingPort(VirtualBoard& board, Lie lie, Told& told)
      : SimulatedPort(board), lie_(std::move(lie)), told_(told) {}

  [[nodiscard]] Status Open() override {
    receiver_ = {};
    waiting_.clear();
    return SimulatedPort::Open();
  }

  Result<size_t> Read(std::span<uint8_t> buffer, Duration longest) override {
    if (waiting_.empty()) {
      std::vector<uint8_t> bytes(256);
      const Result<size_t> count = SimulatedPort::Read(bytes, longest);
      if (!count) {
        return count;
      }
      for (size_t k = 0; k < *count; ++k) {
        SateenFrame frame = {};
        if (SateenReceive(&receiver_, bytes[k], &frame) == SATEEN_FRAME_GOOD) {
          PassOn({.sequence = frame.sequence,
                  .message = frame.message,
                  .payload = {frame.payload, frame.payload + frame.length}});
        }
      }
    }
    const size_t count = std::min(buffer.size(), waiting_.size());
    std::copy_n(waiting_.begin(), count, buffer.begin());
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }

 private:
  void PassOn(Frame frame) {
    if (frame.message == SATEEN_GREETING && lie_.greeting && frame.sequence != 0) {
      SateenGreeting greeting = *Wire<SateenGreeting>::Unpack(frame);
      lie_.greeting(greeting);
      frame.payload = Wire<SateenGreeting>::Pack(greeting);
      ++told_.lies;
    }
    if ((frame.message == SATEEN_STATE || frame.message == SATEEN_REPORT) && !Change(frame)) {
      return;
    }
    const std::vector<uint8_t> wire =
        Encode(frame.sequence, static_cast<uint8_t>(frame.message), frame.payload);
    waiting_.insert(waiting_.end(), wire.begin(), wire.end());
  }

  // Returns whether the answer goes on.
  bool Change(Frame& frame) {
    SateenState said = {};
    SateenUnpackState(frame.payload.data(), &said);
    told_.all_off += said.request == SATEEN_ALL_OFF ? 1 : 0;
    const bool meant = lie_.request < 0 || lie_.request == said.request;
    if (meant && (lie_.state || lie_.swallow) && lie_.honest-- <= 0) {
      if (lie_.swallow) {
        ++told_.lies;
        return false;
      }
      const std::vector<uint8_t> truth = frame.payload;
      lie_.state(said);
      SateenPackState(&said, frame.payload.data());
      told_.lies += frame.payload != truth ? 1 : 0;
    }
    told_.last = said;
    return true;
  }

  Lie lie_;
  Told& told_;
  SateenReceiver receiver_ = {};
  std::deque<uint8_t> waiting_;
};

// All that a board may say and no board may be believed.
inline std::vector<Lie> Lies() {
  const auto lit = [](unsigned mask, int permille) {
    return [mask, permille](SateenState& said) {
      said.lit = static_cast<uint16_t>(mask);
      said.level_permille = static_cast<uint16_t>(permille);
    };
  };
  return {
      {"no channels", [](SateenGreeting& g) { g.channels = 0; }},
      {"17 channels", [](SateenGreeting& g) { g.channels = 17; }},
      {"255 channels", [](SateenGreeting& g) { g.channels = 255; }},
      {"no light may be on", [](SateenGreeting& g) { g.max_lit = 0; }},
      {"more lights on than it has", [](SateenGreeting& g) { g.max_lit = 15; }},
      {"dim clock 3", [](SateenGreeting& g) { g.dim_clock = 3; }},
      {"sync edge 2", [](SateenGreeting& g) { g.sync_edge = 2; }},
      {"silence of 0 ms", [](SateenGreeting& g) { g.silence_ms = 0; }},
      {"silence of 65535 ms", [](SateenGreeting& g) { g.silence_ms = 65535; }},
      {"a level of 65535", [](SateenGreeting& g) { g.max_level_permille[13] = 65535; }},
      {"a level of 1001", [](SateenGreeting& g) { g.max_level_permille[0] = 1001; }},
      {"an on-time of 0", [](SateenGreeting& g) { g.max_on_ms[13] = 0; }},
      {"an on-time of 60001", [](SateenGreeting& g) { g.max_on_ms[0] = 60001; }},
      {"escapes in its build", [](SateenGreeting& g) { g.build_id[7] = 0x1B; }},
      {"protocol 2", [](SateenGreeting& g) { g.protocol_major = 2; }},
      {"all off, and light 5 on", {}, lit(1U << 5, 1000), SATEEN_ALL_OFF},
      {"all off, and the asked one on", {}, lit(1U << 3, 500), SATEEN_ALL_OFF},
      {"all off, and all on", {}, lit(0xFFFF, 1000), SATEEN_ALL_OFF},
      {"all off, and a light it has not", {}, lit(1U << 15, 1000), SATEEN_ALL_OFF},
      {"all off, and a level", {}, lit(0, 500), SATEEN_ALL_OFF},
      {"all off, and armed", {}, [](SateenState& s) { s.armed = 2; }, SATEEN_ALL_OFF},
      {"all off, and the shutter", {}, [](SateenState& s) { s.shutter_ms = 9; }, SATEEN_ALL_OFF},
      {"all off refused", {}, [](SateenState& s) { s.result = 6; }, SATEEN_ALL_OFF},
      {"all off with result 200", {}, [](SateenState& s) { s.result = 200; }, SATEEN_ALL_OFF},
      {"all off for another", {}, [](SateenState& s) { s.request = 4; }, SATEEN_ALL_OFF},
      {"all off not answered", {}, {}, SATEEN_ALL_OFF, 0, true},
      {"one beside the asked", {}, [](SateenState& s) { s.lit |= 1U << 9; }, SATEEN_SET_LIGHT},
      {"another than the asked", {}, lit(1U << 9, 500), SATEEN_SET_LIGHT},
      {"none of the asked", {}, lit(0, 0), SATEEN_SET_LIGHT},
      {"another level", {}, [](SateenState& s) { s.level_permille ^= 3; }, SATEEN_SET_LIGHT},
      {"level 65535", {}, [](SateenState& s) { s.level_permille = 65535; }, SATEEN_SET_LIGHT},
      {"for longer", {}, [](SateenState& s) { s.left_ms = 60000; }, SATEEN_SET_LIGHT},
      {"for over a minute", {}, [](SateenState& s) { s.lit_ms = 65535; }, SATEEN_SET_LIGHT},
      {"later one beside it", {}, [](SateenState& s) { s.lit |= 1U << 9; }, SATEEN_STATUS},
      {"later another", {}, lit(1U << 9, 500), SATEEN_STATUS},
      {"later one it has not", {}, lit(1U << 14, 500), SATEEN_STATUS},
      {"later off too early", {}, lit(0, 0), SATEEN_STATUS},
      {"always light 5", {}, lit(1U << 5, 1000)},
      {"never an answer", {}, {}, -1, 0, true},
      {"never greeted", {}, [](SateenState& s) { s.result = SATEEN_RESULT_NOT_GREETED; }},
  };
}

}  // namespace sateen::testing
