#include "scanner/devices/board_link.h"

#include <algorithm>
#include <cctype>
#include <string_view>
#include <utility>

#include "scanner/devices/board_answer.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;
using State = LightBoard::State;

// Between two tries to open a port, or to be greeted.
constexpr milliseconds kOpenInterval{20};
constexpr milliseconds kHelloInterval{100};
// 65 bytes of EEPROM at 3.4 ms, and then some.
constexpr milliseconds kSlowExtra{400};

std::string_view ResultText(std::uint8_t result) {
  switch (result) {
#define SATEEN_RESULT_TEXT(NAME, number, text) \
  case number:                                 \
    return text;
    SATEEN_RESULTS(SATEEN_RESULT_TEXT)
#undef SATEEN_RESULT_TEXT
    default:
      return "a reason that this program does not know";
  }
}

}  // namespace

std::string BoardLink::Words(std::string_view name) {
  std::string words(name);
  std::ranges::transform(words, words.begin(), [](unsigned char letter) {
    return letter == '_' ? ' ' : static_cast<char>(std::tolower(letter));
  });
  return words;
}

BoardLink::BoardLink(std::unique_ptr<BytePort> port, const LightBoardOptions& options)
    : port_(std::move(port)), options_(options) {}

BoardLink::Wire BoardLink::Encode(std::uint8_t message, std::span<const std::uint8_t> payload) {
  sequence_ = sequence_ == 255 ? std::uint8_t{1} : static_cast<std::uint8_t>(sequence_ + 1);
  Wire wire;
  wire.count = SateenEncodeFrame(sequence_, message, payload.data(),
                                 static_cast<std::uint8_t>(payload.size()), wire.bytes.data());
  return wire;
}

Status BoardLink::Write(const Wire& wire) {
  return port_->Write(std::span(wire.bytes).first(wire.count));
}

Result<BoardLink::Frame> BoardLink::ReadFrame(BytePort::Duration deadline) {
  while (true) {
    for (; next_ < end_; ++next_) {
      SateenFrame received = {};
      Frame frame;
      frame.status = SateenReceive(&receiver_, arrived_[next_], &received);
      if (frame.status == SATEEN_FRAME_NONE) {
        continue;
      }
      ++next_;
      if (frame.status == SATEEN_FRAME_GOOD) {
        frame.sequence = received.sequence;
        frame.message = received.message;
        frame.length = received.length;
        std::copy_n(received.payload, received.length, frame.payload.begin());
      }
      return frame;
    }
    const BytePort::Duration left = deadline - port_->Now();
    if (left <= BytePort::Duration::zero()) {
      return Frame{};
    }
    const Result<std::size_t> count = port_->Read(arrived_, left);
    if (!count) {
      return tl::unexpected(count.error());
    }
    next_ = 0;
    end_ = *count;
  }
}

Result<BoardLink::Heard> BoardLink::AwaitAnswer(std::uint8_t answer, std::size_t size,
                                                BytePort::Duration deadline, Frame& frame) {
  while (true) {
    Result<Frame> read = ReadFrame(deadline);
    if (!read) {
      return tl::unexpected(read.error());
    }
    if (read->status == SATEEN_FRAME_NONE) {
      return Heard::kNothing;
    }
    if (read->status != SATEEN_FRAME_GOOD) {
      continue;
    }
    if (read->sequence == 0 && read->message == SATEEN_GREETING) {
      return Heard::kGreeting;
    }
    if (read->sequence == 0 && read->message == SATEEN_BAD_FRAME) {
      return Heard::kBadFrame;
    }
    if (read->sequence == sequence_ && read->message == answer && read->length == size) {
      frame = *read;
      return Heard::kAnswer;
    }
  }
}

Result<BoardLink::Frame> BoardLink::Exchange(const char* name, std::uint8_t message,
                                             std::span<const std::uint8_t> payload,
                                             std::uint8_t answer, std::size_t size, bool slow) {
  if (const Status ready = CheckReady(name); !ready) {
    return tl::unexpected(ready.error());
  }
  const Wire wire = Encode(message, payload);
  const BytePort::Duration timeout =
      options_.answer_timeout + (slow ? kSlowExtra : milliseconds::zero());
  for (int tried = 0; tried < options_.tries; ++tried) {
    Frame frame;
    Result<Heard> heard = Heard::kNothing;
    if (const Status written = Write(wire); !written) {
      heard = tl::unexpected(written.error());
    } else {
      heard = AwaitAnswer(answer, size, port_->Now() + timeout, frame);
    }
    if (!heard) {
      Lose();
      return Fail(ErrorCode::kDevice,
                  "{}, before '{}' was answered; the board turns everything off within 2 s; plug "
                  "it in again",
                  heard.error().message, Words(name));
    }
    if (*heard == Heard::kAnswer) {
      return frame;
    }
    if (*heard == Heard::kGreeting) {
      return Restarted(name);
    }
  }
  Lose();
  return Fail(ErrorCode::kTimeout,
              "{}: no answer to '{}', sent {} times; the board turns everything off within 2 s; "
              "check its supply and its cable",
              port_->Name(), Words(name), options_.tries);
}

Status BoardLink::CheckReady(const char* name) const {
  switch (state_) {
    case State::kReady:
      return {};
    case State::kClosed:
      return Fail(ErrorCode::kDevice, "{}: '{}' needs a connection; connect first", port_->Name(),
                  Words(name));
    case State::kLost:
      return Fail(ErrorCode::kDevice, "{}: the connection was lost; connect again before '{}'",
                  port_->Name(), Words(name));
    case State::kRestarted:
      return Fail(ErrorCode::kDevice,
                  "{}: the board has restarted and all lights are off; connect again before '{}'",
                  port_->Name(), Words(name));
  }
  return {};
}

Status BoardLink::CheckDone(const char* name, std::uint8_t message, const SateenState& answer) {
  if (answer.request != message) {
    return Fail(ErrorCode::kDevice,
                "{}: told '{}', the board answers another command; is it Sateen's firmware? 'make "
                "flash' uploads it",
                port_->Name(), Words(name));
  }
  if (answer.result == SATEEN_RESULT_DONE) {
    return {};
  }
  if (answer.result == SATEEN_RESULT_NOT_GREETED) {
    return Restarted(name);
  }
  return Fail(ErrorCode::kDevice, "{}: the board refused '{}': {}{}; nothing was changed",
              port_->Name(), Words(name), ResultText(answer.result),
              answer.fault == SATEEN_FAULT_NONE
                  ? ""
                  : fmt::format(" (fault {}: {})", answer.fault, FaultText(answer.fault)));
}

tl::unexpected<Error> BoardLink::Restarted(const char* name) {
  state_ = State::kRestarted;
  return Fail(ErrorCode::kDevice,
              "{}: the board restarted before '{}' was answered and all lights are off; connect "
              "again; 'sateen light status' shows why it restarted",
              port_->Name(), Words(name));
}

Result<SateenGreeting> BoardLink::Greet(BytePort::Duration deadline) {
  const SateenHello hello = {.protocol_major = SATEEN_PROTOCOL_MAJOR,
                             .protocol_minor = SATEEN_PROTOCOL_MINOR};
  std::array<std::uint8_t, SATEEN_HELLO_SIZE> payload;
  SateenPackHello(&hello, payload.data());
  const Wire wire = Encode(SATEEN_HELLO, payload);
  while (port_->Now() < deadline) {
    if (const Status written = Write(wire); !written) {
      return tl::unexpected(written.error());
    }
    Frame frame;
    const BytePort::Duration patience = port_->Now() + kHelloInterval;
    const Result<Heard> heard =
        AwaitAnswer(SATEEN_GREETING, SATEEN_GREETING_SIZE, std::min(patience, deadline), frame);
    if (!heard) {
      return tl::unexpected(heard.error());
    }
    if (*heard == Heard::kAnswer) {
      SateenGreeting greeting;
      SateenUnpackGreeting(frame.payload.data(), &greeting);
      return greeting;
    }
  }
  return Fail(
      ErrorCode::kTimeout,
      "{}: no greeting within {} ms; is it an LED board with Sateen's firmware? 'make flash' "
      "uploads it; another port is chosen with --port",
      port_->Name(), options_.greeting_timeout.count());
}

Result<SateenGreeting> BoardLink::Connect(milliseconds port_wait) {
  const BytePort::Duration begun = port_->Now();
  const BytePort::Duration deadline = begun + options_.greeting_timeout;
  const bool was_closed = state_ == State::kClosed;
  Result<SateenGreeting> greeting =
      Fail(ErrorCode::kTimeout, "{}: greeting_timeout is too short", port_->Name());
  while (port_->Now() < deadline) {
    if (!open_) {
      if (const Status opened = port_->Open(); !opened) {
        greeting = tl::unexpected(opened.error());
        if (was_closed || port_->Now() - begun >= port_wait) {
          break;
        }
        port_->Wait(kOpenInterval);
        continue;
      }
      open_ = true;
      receiver_ = {};
      next_ = end_ = 0;
    }
    greeting = Greet(deadline);
    if (greeting || greeting.error().code == ErrorCode::kTimeout) {
      break;
    }
    Lose();  // the port went away meanwhile; it may come back
    port_->Wait(kOpenInterval);
  }
  if (greeting && greeting->protocol_major != SATEEN_PROTOCOL_MAJOR) {
    greeting = Fail(ErrorCode::kDevice,
                    "{}: the board speaks protocol {}.{}, this program {}.{}; 'make flash' brings "
                    "its firmware up to this program",
                    port_->Name(), greeting->protocol_major, greeting->protocol_minor,
                    SATEEN_PROTOCOL_MAJOR, SATEEN_PROTOCOL_MINOR);
  }
  if (greeting) {
    if (const Status possible = CheckGreeting(*greeting, port_->Name()); !possible) {
      greeting = tl::unexpected(possible.error());
    }
  }
  if (!greeting) {
    Lose();
    return greeting;
  }
  state_ = State::kReady;
  return greeting;
}

void BoardLink::Lose() noexcept {
  if (open_) {
    port_->Close();
    open_ = false;
  }
  if (state_ != State::kClosed) {
    state_ = State::kLost;
  }
}

void BoardLink::Close() noexcept {
  if (state_ == State::kReady) {
    // The board's own time-out is behind this, so that nothing depends on its arrival.
    const Status ignored = Write(Encode(SATEEN_ALL_OFF, {}));
  }
  Lose();
  state_ = State::kClosed;
}

}  // namespace sateen
