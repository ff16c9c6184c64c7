#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "firmware/protocol/codec.h"
#include "firmware/protocol/frame.h"
#include "scanner/devices/byte_port.h"

// An LED board in a few lines and in simulated time: what docs/protocol.md says, and every fault
// that a cable has. The firmware itself is tested where the virtual rig is; this is for the host's
// side.
namespace sateen::testing {

struct Noise {
  double drop = 0.0;  // probabilities for each byte
  double flip = 0.0;
  double insert = 0.0;
};

class FakeBoard {
 public:
  using Time = std::chrono::microseconds;
  static constexpr int kChannels = 14;

  // ---- what tests set ----
  Noise to_board;
  Noise to_host;
  std::mt19937 random{1};
  bool plugged = true;
  Time latency{800};  // from command to answer
  int protocol_major = SATEEN_PROTOCOL_MAJOR;
  int mute = 0;                     // so many answers are not sent
  int refuse = SATEEN_RESULT_DONE;  // result of every command but hello
  Time boot{0};                     // after opening, deaf for so long and then a greeting
  std::uint16_t max_on_ms = 10000;
  int hello_count = 0;

  // ---- what tests look at ----
  Time now{0};
  std::set<int> lit;
  std::uint16_t level_permille = 0;
  std::vector<SateenSetLight> lights_set;  // each execution
  std::map<int, int> executed;             // by message id
  int frames_received = 0;
  int opened = 0;

  void Restart() {
    lit.clear();
    greeted = false;
    last_sequence = 0;
    receiver = {};
    SendGreeting(0, now);
  }
  void Unplug() {
    plugged = false;
    lit.clear();  // the cable is the supply of the controller
    greeted = false;
    last_sequence = 0;
  }
  void Replug() {
    plugged = true;
    receiver = {};
    outbox.clear();
  }
  void SendGarbage(const std::vector<std::uint8_t>& bytes) { Queue(bytes, now); }

  void AdvanceTo(Time to) {
    now = std::max(now, to);
    if (now < deaf_until) {
      return;
    }
    if (boot_greeting_due) {
      boot_greeting_due = false;
      Restart();
    }
    if (now - heard >= Time(SATEEN_SILENCE_MS * 1000) || now >= off_at) {
      lit.clear();
    }
  }

  // ---- the port ----
  void Opened() {
    ++opened;
    outbox.clear();
    receiver = {};
    if (boot > Time::zero()) {
      deaf_until = now + boot;
      boot_greeting_due = true;
    }
  }
  void Take(std::span<const std::uint8_t> bytes) {
    AdvanceTo(now);
    for (const std::uint8_t byte : Spoiled({bytes.begin(), bytes.end()}, to_board)) {
      SateenFrame frame = {};
      if (now < deaf_until) {
        continue;
      }
      const int status = SateenReceive(&receiver, byte, &frame);
      if (status == SATEEN_FRAME_GOOD) {
        Do(frame);
      } else if (status != SATEEN_FRAME_NONE) {
        SateenBadFrame bad = {.problem = static_cast<std::uint8_t>(status)};
        Send(0, bad, SATEEN_BAD_FRAME, SATEEN_BAD_FRAME_SIZE, SateenPackBadFrame, now + latency);
      }
    }
  }
  std::size_t Give(std::span<std::uint8_t> buffer, Time longest) {
    const Time deadline = now + longest;
    while (outbox.empty() || outbox.front().at > now) {
      const Time next = outbox.empty() ? deadline : std::min(deadline, outbox.front().at);
      const Time due = boot_greeting_due ? std::min(next, deaf_until) : next;
      if (due <= now && next == deadline) {
        return 0;
      }
      AdvanceTo(std::max(due, now + Time(1)));
      if (now >= deadline && (outbox.empty() || outbox.front().at > now)) {
        return 0;
      }
    }
    std::size_t count = 0;
    while (count < buffer.size() && !outbox.empty() && outbox.front().at <= now) {
      buffer[count++] = outbox.front().byte;
      outbox.pop_front();
    }
    return count;
  }

 private:
  struct Sent {
    Time at;
    std::uint8_t byte;
  };

  std::vector<std::uint8_t> Spoiled(std::vector<std::uint8_t> bytes, const Noise& noise) {
    std::vector<std::uint8_t> spoiled;
    std::uniform_real_distribution<double> chance(0.0, 1.0);
    for (std::uint8_t byte : bytes) {
      if (chance(random) < noise.insert) {
        spoiled.push_back(static_cast<std::uint8_t>(random()));
      }
      if (chance(random) < noise.drop) {
        continue;
      }
      if (chance(random) < noise.flip) {
        byte = static_cast<std::uint8_t>(byte ^ (1u << (random() % 8)));
      }
      spoiled.push_back(byte);
    }
    return spoiled;
  }

  void Queue(const std::vector<std::uint8_t>& bytes, Time at) {
    for (const std::uint8_t byte : Spoiled(bytes, to_host)) {
      outbox.push_back({at, byte});
    }
  }

  template <typename Fields, typename Pack>
  void Send(std::uint8_t sequence, const Fields& fields, std::uint8_t message, std::size_t size,
            Pack pack, Time at) {
    std::vector<std::uint8_t> payload(size);
    pack(&fields, payload.data());
    std::vector<std::uint8_t> wire(SATEEN_MAX_WIRE);
    wire.resize(SateenEncodeFrame(sequence, message, payload.data(),
                                  static_cast<std::uint8_t>(size), wire.data()));
    if (mute > 0) {
      --mute;
      return;
    }
    Queue(wire, at);
  }

  void SendGreeting(std::uint8_t sequence, Time at) {
    SateenGreeting greeting = {};
    greeting.protocol_major = static_cast<std::uint8_t>(protocol_major);
    greeting.channels = kChannels;
    greeting.max_lit = 1;
    greeting.silence_ms = SATEEN_SILENCE_MS;
    greeting.reset_cause = SATEEN_RESET_POWER_ON;
    std::memcpy(greeting.build_id, "fakefake", SATEEN_BUILD_ID_SIZE);
    std::fill_n(greeting.max_level_permille, kChannels, std::uint16_t{900});
    std::fill_n(greeting.max_on_ms, kChannels, max_on_ms);
    Send(sequence, greeting, SATEEN_GREETING, SATEEN_GREETING_SIZE, SateenPackGreeting, at);
  }

  int Execute(const SateenFrame& frame) {
    if (!greeted && frame.message != SATEEN_STATUS && frame.message != SATEEN_ALL_OFF) {
      return SATEEN_RESULT_NOT_GREETED;
    }
    if (refuse != SATEEN_RESULT_DONE) {
      return refuse;
    }
    ++executed[frame.message];
    if (frame.message == SATEEN_SET_LIGHT) {
      SateenSetLight light;
      SateenUnpackSetLight(frame.payload, &light);
      lights_set.push_back(light);
      lit.clear();
      if (light.level_permille > 0) {
        lit.insert(light.channel);
        level_permille = light.level_permille;
        off_at = now + Time(1000 * light.on_ms);
      }
    } else if (frame.message == SATEEN_ALL_OFF) {
      lit.clear();
    }
    return SATEEN_RESULT_DONE;
  }

  void Do(const SateenFrame& frame) {
    ++frames_received;
    heard = now;
    if (frame.message == SATEEN_HELLO) {
      ++hello_count;
      greeted = true;
      lit.clear();
      SendGreeting(frame.sequence, now + latency);
      last_sequence = 0;
      return;
    }
    if (frame.sequence == 0) {
      last_result = SATEEN_RESULT_OUT_OF_RANGE;
    } else if (frame.sequence != last_sequence) {
      last_result = Execute(frame);
      last_sequence = frame.sequence;
    }
    SateenReport report = {.request = frame.message,
                           .result = static_cast<std::uint8_t>(last_result)};
    for (const int channel : lit) {
      report.lit = static_cast<std::uint16_t>(report.lit | (1u << channel));
      report.level_permille = level_permille;
    }
    report.armed = SATEEN_NO_CHANNEL;
    report.frames = static_cast<std::uint32_t>(frames_received);
    if (frame.message == SATEEN_STATUS) {
      Send(frame.sequence, report, SATEEN_REPORT, SATEEN_REPORT_SIZE, SateenPackReport,
           now + latency);
      return;
    }
    SateenState state = {};
    std::uint8_t fields[SATEEN_REPORT_SIZE];
    SateenPackReport(&report, fields);  // begins with the fields of the state
    SateenUnpackState(fields, &state);
    Send(frame.sequence, state, SATEEN_STATE, SATEEN_STATE_SIZE, SateenPackState, now + latency);
  }

  SateenReceiver receiver = {};
  std::deque<Sent> outbox;
  bool greeted = false;
  bool boot_greeting_due = false;
  int last_sequence = 0;
  int last_result = 0;
  Time heard{0};
  Time off_at{0};
  Time deaf_until{0};
};

// The host's end of the cable; the board outlives it.
class FakePort : public BytePort {
 public:
  explicit FakePort(FakeBoard& board) : board_(board) {}
  [[nodiscard]] std::string Name() const override { return "fake"; }
  [[nodiscard]] Status Open() override {
    if (!board_.plugged) {
      return Fail(ErrorCode::kDevice, "fake: not there");
    }
    open_ = true;
    board_.Opened();
    return {};
  }
  void Close() noexcept override { open_ = false; }
  [[nodiscard]] Status Write(std::span<const std::uint8_t> bytes) override {
    if (!open_ || !board_.plugged) {
      return Fail(ErrorCode::kDevice, "fake: the port is gone");
    }
    board_.Take(bytes);
    return {};
  }
  [[nodiscard]] Result<std::size_t> Read(std::span<std::uint8_t> buffer,
                                         Duration longest) override {
    if (!open_ || !board_.plugged) {
      return Fail(ErrorCode::kDevice, "fake: the port is gone");
    }
    return board_.Give(buffer, longest);
  }
  [[nodiscard]] Duration Now() const override { return board_.now; }
  void Wait(Duration time) override {
    board_.AdvanceTo(board_.now + time);
    if (on_wait) {
      on_wait();
    }
  }
  std::function<void()> on_wait;  // after each wait

 private:
  FakeBoard& board_;
  bool open_ = false;
};

}  // namespace sateen::testing
