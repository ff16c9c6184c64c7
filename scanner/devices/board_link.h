#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "firmware/protocol/codec.h"
#include "firmware/protocol/frame.h"
#include "scanner/devices/byte_port.h"
#include "scanner/devices/light_board.h"

namespace sateen {

// Facts of each message from the table, for templates: id, size, answer, pack, unpack.
template <typename Fields>
struct BoardMessage;

#define SATEEN_BOARD_MESSAGE(NAME, Name, id, text)             \
  template <>                                                  \
  struct BoardMessage<Sateen##Name> {                          \
    static constexpr std::uint8_t kId = id;                    \
    static constexpr std::size_t kSize = SATEEN_##NAME##_SIZE; \
    static constexpr auto kPack = SateenPack##Name;            \
    static constexpr auto kUnpack = SateenUnpack##Name;        \
    static constexpr const char* kName = #NAME;                \
  };
#define SATEEN_BOARD_REQUEST(NAME, Name, id, ANSWER, text) \
  SATEEN_BOARD_MESSAGE(NAME, Name, id, text)
SATEEN_REQUESTS(SATEEN_BOARD_REQUEST)
SATEEN_ANSWERS(SATEEN_BOARD_MESSAGE)
#undef SATEEN_BOARD_REQUEST
#undef SATEEN_BOARD_MESSAGE

// Frames over a port: sequence numbers, time-outs, sending again, and the states of LightBoard,
// whose header describes them.
class BoardLink {
 public:
  BoardLink(std::unique_ptr<BytePort> port, const LightBoardOptions& options);

  // Returns a name such as "SET_LIGHT" as people read it.
  [[nodiscard]] static std::string Words(std::string_view name);

  [[nodiscard]] LightBoard::State state() const { return state_; }
  [[nodiscard]] BytePort& port() { return *port_; }

  // Opens the port where it is not open, says hello until the board greets. Waits at most
  // `port_wait` for a port that is not there.
  [[nodiscard]] Result<SateenGreeting> Connect(std::chrono::milliseconds port_wait);
  void Close() noexcept;

  // Sends the command until its answer comes, whatever that says; `Answer` is what the table says
  // that it is answered by. `slow` waits as long as writing the EEPROM may take.
  template <typename Answer, typename Request>
  [[nodiscard]] Result<Answer> Command(const Request& request, bool slow = false) {
    using Message = BoardMessage<Request>;
    std::array<std::uint8_t, SATEEN_MAX_PAYLOAD> payload;
    Message::kPack(&request, payload.data());
    const Result<Frame> frame =
        Exchange(Message::kName, Message::kId, std::span(payload).first(Message::kSize),
                 BoardMessage<Answer>::kId, BoardMessage<Answer>::kSize, slow);
    if (!frame) {
      return tl::unexpected(frame.error());
    }
    Answer answer;
    BoardMessage<Answer>::kUnpack(frame->payload.data(), &answer);
    return answer;
  }
  // Fails unless the board says that it has done the command `message`, which is called `name`.
  // After "not greeted" the state is kRestarted.
  [[nodiscard]] Status CheckDone(const char* name, std::uint8_t message, const SateenState& answer);

 private:
  // A received frame that owns its payload.
  struct Frame {
    std::uint8_t status = SATEEN_FRAME_NONE;
    std::uint8_t sequence = 0;
    std::uint8_t message = 0;
    std::uint8_t length = 0;
    std::array<std::uint8_t, SATEEN_MAX_PAYLOAD> payload{};
  };
  struct Wire {
    std::uint8_t count = 0;
    std::array<std::uint8_t, SATEEN_MAX_WIRE> bytes{};
  };
  enum class Heard { kNothing, kAnswer, kBadFrame, kGreeting };

  [[nodiscard]] Wire Encode(std::uint8_t message, std::span<const std::uint8_t> payload);
  [[nodiscard]] Status Write(const Wire& wire);
  // Reads the next frame, good or not; status NONE when the deadline has passed.
  [[nodiscard]] Result<Frame> ReadFrame(BytePort::Duration deadline);
  // Waits for the answer with the sequence number last encoded. kGreeting: one that was not asked
  // for, so the board has just started.
  [[nodiscard]] Result<Heard> AwaitAnswer(std::uint8_t answer, std::size_t size,
                                          BytePort::Duration deadline, Frame& frame);
  [[nodiscard]] Result<Frame> Exchange(const char* name, std::uint8_t message,
                                       std::span<const std::uint8_t> payload, std::uint8_t answer,
                                       std::size_t size, bool slow);
  [[nodiscard]] Status CheckReady(const char* name) const;
  [[nodiscard]] Result<SateenGreeting> Greet(BytePort::Duration deadline);
  [[nodiscard]] tl::unexpected<Error> Restarted(const char* name);
  void Lose() noexcept;

  std::unique_ptr<BytePort> port_;
  LightBoardOptions options_;
  LightBoard::State state_ = LightBoard::State::kClosed;
  bool open_ = false;
  std::uint8_t sequence_ = 0;
  SateenReceiver receiver_{};
  std::array<std::uint8_t, 256> arrived_{};  // from next_ to end_ not yet looked at
  std::size_t next_ = 0;
  std::size_t end_ = 0;
};

}  // namespace sateen
