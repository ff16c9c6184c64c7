#pragma once

#include <gmock/gmock.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/protocol/codec.h"
#include "firmware/protocol/frame.h"
#include "scanner/devices/board_link.h"
#include "simulation/virtual_rig/board/virtual_board.h"
#include "tests/testing/places.h"

// Speaks the protocol with the firmware, frame by frame, in simulated time.
namespace sateen::testing {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

inline std::filesystem::path Firmware() {
  return std::filesystem::path(testing::FirmwareDir()) / "sateen-controller.elf";
}
inline std::filesystem::path FirmwareFor16Lights() {
  return std::filesystem::path(testing::FirmwareDir()) / "sateen-controller-16.elf";
}
// Hangs when it is told to.
inline std::filesystem::path TestFirmware() {
  return std::filesystem::path(testing::FirmwareDir()) / "sateen-controller-test.elf";
}

struct Frame {
  uint8_t sequence = 0;
  int message = -1;  // -1: none came
  std::vector<uint8_t> payload;
};

inline std::vector<uint8_t> Encode(uint8_t sequence, uint8_t message,
                                   const std::vector<uint8_t>& payload = {}) {
  std::vector<uint8_t> wire(SATEEN_MAX_WIRE);
  wire.resize(SateenEncodeFrame(sequence, message, payload.data(),
                                static_cast<uint8_t>(payload.size()), wire.data()));
  return wire;
}

// A message's payload from and to its struct.
template <typename Message>
struct Wire {
  using Traits = BoardMessage<Message>;
  static constexpr uint8_t kId = Traits::kId;

  static std::vector<uint8_t> Pack(const Message& fields) {
    std::vector<uint8_t> payload(Traits::kSize);
    Traits::kPack(&fields, payload.data());
    return payload;
  }
  static std::optional<Message> Unpack(const Frame& frame) {
    if (frame.message != kId || frame.payload.size() != Traits::kSize) {
      return std::nullopt;
    }
    Message fields = {};
    Traits::kUnpack(frame.payload.data(), &fields);
    return fields;
  }
};

// One host that talks to one board. `others` keeps what came unasked.
class Talk {
 public:
  explicit Talk(VirtualBoard& board) : board_(&board) {}

  // Sends bytes and returns the frames that come within `time`.
  std::vector<Frame> SendAndListen(const std::vector<uint8_t>& bytes, SimTime time) {
    board_->Send(bytes);
    board_->RunFor(time);
    return Frames();
  }

  std::vector<Frame> Frames() {
    std::vector<Frame> frames;
    for (const uint8_t byte : board_->TakeSent()) {
      SateenFrame frame = {};
      if (SateenReceive(&receiver_, byte, &frame) == SATEEN_FRAME_GOOD) {
        frames.push_back({.sequence = frame.sequence,
                          .message = frame.message,
                          .payload = {frame.payload, frame.payload + frame.length}});
      }
    }
    return frames;
  }

  Frame Exchange(uint8_t message, const std::vector<uint8_t>& payload) {
    sequence_ = static_cast<uint8_t>(sequence_ % 255 + 1);
    return Exchange(sequence_, message, payload);
  }

  Frame Exchange(uint8_t sequence, uint8_t message, const std::vector<uint8_t>& payload) {
    board_->Send(Encode(sequence, message, payload));
    Frame answer;
    board_->RunUntil(
        [&] {
          for (Frame& frame : Frames()) {
            (frame.sequence == sequence ? answer : others.emplace_back()) = std::move(frame);
          }
          return answer.message >= 0;
        },
        milliseconds(500));
    return answer;
  }

  template <typename Answer, typename Request>
  Answer Ask(const Request& request) {
    const Frame frame = Exchange(Wire<Request>::kId, Wire<Request>::Pack(request));
    const std::optional<Answer> answer = Wire<Answer>::Unpack(frame);
    EXPECT_TRUE(answer) << "message " << int{Wire<Request>::kId} << " was answered by "
                        << frame.message;
    return answer.value_or(Answer{});
  }

  template <typename Request>
  SateenState Do(const Request& request) {
    return Ask<SateenState>(request);
  }

  SateenGreeting Hello() {
    return Ask<SateenGreeting>(SateenHello{.protocol_major = SATEEN_PROTOCOL_MAJOR,
                                           .protocol_minor = SATEEN_PROTOCOL_MINOR});
  }
  SateenState Light(int channel, int permille, int on_ms, bool add = false) {
    return Do(SateenSetLight{.channel = static_cast<uint8_t>(channel),
                             .level_permille = static_cast<uint16_t>(permille),
                             .on_ms = static_cast<uint16_t>(on_ms),
                             .add = static_cast<uint8_t>(add ? 1 : 0)});
  }
  SateenReport Status() { return Ask<SateenReport>(SateenStatus{}); }

  // The first unasked frame of this kind, which is then forgotten.
  template <typename Message>
  std::optional<Message> TakeUnasked() {
    for (Frame& frame : Frames()) {
      others.push_back(std::move(frame));
    }
    for (size_t i = 0; i < others.size(); ++i) {
      if (const auto message = Wire<Message>::Unpack(others[i])) {
        others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
        return message;
      }
    }
    return std::nullopt;
  }

  std::vector<Frame> others;

 private:
  VirtualBoard* board_;
  SateenReceiver receiver_ = {};
  uint8_t sequence_ = 0;
};

// A board that runs the firmware, and a witness that no light is ever on for longer, brighter or in
// greater number than it may be. A test that configures the board says so in `may`.
class BoardTest : public ::testing::Test {
 protected:
  struct Allowed {
    milliseconds on{10'000};  // limit of a new board
    double level = 1;
  };

  BoardTest() { Start(Firmware()); }

  ~BoardTest() override {
    if (board_ != nullptr) {
      CheckRecords();
    }
  }

  void Start(const std::filesystem::path& firmware,
             const BoardWiring& wiring = ControllerWiring()) {
    auto board = VirtualBoard::Load(firmware, wiring);
    ASSERT_TRUE(board) << board.error().message;
    board_ = std::move(*board);
    board_->Watch({.light = [this](const LightChange&) {
      EXPECT_LE(board_->Lit().size(), may_be_lit_) << "at " << board_->Now().count() << " ns";
    }});
    board_->RunFor(milliseconds(20));
    talk_.emplace(*board_);
    talk_->Frames();
  }

  void CheckRecords() {
    const std::vector<ChannelRecord> records = board_->Records();
    for (size_t k = 0; k < records.size(); ++k) {
      EXPECT_LE(records[k].longest_on, SimTime(may_[k].on) + kTimerSlack) << "light " << k;
      EXPECT_LE(records[k].highest_level, may_[k].level + 1e-9) << "light " << k;
    }
  }

  // On and off are a few instructions apart from the tick that counts.
  static constexpr SimTime kTimerSlack = microseconds(50);

  std::unique_ptr<VirtualBoard> board_;
  std::optional<Talk> talk_;
  std::array<Allowed, SATEEN_MAX_CHANNELS> may_;
  size_t may_be_lit_ = 1;
};

}  // namespace sateen::testing
