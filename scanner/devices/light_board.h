#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/devices/byte_port.h"

namespace sateen {

class BoardLink;

// Limits of one light. The board enforces them.
struct LightLimits {
  double max_level = 1.0;  // [0, 1]
  std::chrono::milliseconds max_on{0};
};

// Settings that the board keeps in its EEPROM.
struct BoardSettings {
  int max_lit = 1;    // lights that may be on together, at one level; at least 1
  int dim_clock = 0;  // dimming line: 0: 16 kHz, 1: 2 kHz, 2: 250 Hz
  bool sync_rising = false;
};

// The board's description of itself in its greeting.
struct BoardInfo {
  std::string protocol;  // "1.0"
  std::string build_id;
  BoardSettings settings;
  std::chrono::milliseconds silence{0};  // without a host for this long it turns everything off
  std::string reset_cause;
  int fault = 0;
  std::vector<LightLimits> lights;  // one for each channel
};

// State of the outputs when the board answered.
struct BoardState {
  int fault = 0;       // the latest that was not cleared; FaultText() has the words
  unsigned lit = 0;    // bit k: light k is on
  double level = 0.0;  // level of the lights that are on, [0, 1]
  std::chrono::milliseconds lit_for{0};  // since the first of them went on
  std::chrono::milliseconds left{0};     // until the first of them goes off
  int armed = -1;                        // the light that waits for the flash sync, or -1
  std::chrono::milliseconds shutter{0};  // how much longer the shutter output is closed
};

// The state, and what happened since the board started.
struct BoardReport {
  BoardState state;
  std::string reset_cause;
  std::chrono::milliseconds uptime{0};
  std::uint32_t frames = 0;
  unsigned bad_frames = 0;
  unsigned overruns = 0;
  unsigned refused = 0;
  unsigned repeats = 0;
  unsigned unsent = 0;
  unsigned syncs = 0;
  unsigned flashes = 0;
  unsigned faults = 0;
};

// Returns the meaning of the number in words.
[[nodiscard]] std::string FaultText(int fault);

// Returns the channels whose bit is set.
[[nodiscard]] std::vector<int> LitChannels(unsigned lit);
// Returns "light 5", "lights 5 and 6", "no light".
[[nodiscard]] std::string LightsText(unsigned lit);

struct LightBoardOptions {
  // Longest wait for one answer before the command is sent again; at least 1 ms.
  std::chrono::milliseconds answer_timeout{60};
  // How often a command is sent in all before it has failed; at least 1.
  int tries = 8;
  // Longest wait for the greeting, from opening the port; the bootloader of an Uno takes 1 s of it.
  std::chrono::milliseconds greeting_timeout{3000};

  [[nodiscard]] Status Validate() const;
};

// Longest wait for a port that is not there, where only LightBoardOptions::greeting_timeout ends it.
inline constexpr std::chrono::milliseconds kUntilGreetingTimeout{86'400'000};

/// The LED board at the end of a serial port. One owner, move-only, one thread at a time.
///
///     state        legal                what leads out of it
///     kClosed      Connect              -> kReady; an error leaves it kClosed
///     kReady       everything           the port is lost, or no answer after all tries -> kLost
///                                       a greeting that was not asked for, or "not greeted" from
///                                       the board: it has restarted, all is off      -> kRestarted
///                                       Close -> kClosed
///     kLost        Connect, Close       Connect opens the port anew                     -> kReady
///     kRestarted   Connect, Close       Connect greets on the open port                 -> kReady
///
/// Connect says hello, on which the board turns everything off, so kReady begins with all lights
/// off. In other states than kReady commands send nothing and fail with kDevice, so that nobody
/// believes a light to be on that went off with the board. A command that the board refuses is an
/// error and changes nothing; the state stays kReady.
///
/// A command is sent again, as the very same frame, where no answer or "bad frame" comes; the board
/// executes it once. Its answer is the state after it. Bytes that are no frame are skipped, answers
/// to other commands ignored.
///
/// A command has succeeded where the board's answer says so: all off and no light is on, set light
/// and this light is on at this level, alone unless others were added. Another answer is an error
/// that tells it, and the state stays kReady. A greeting whose values cannot be is no connection.
///
/// The board turns everything off when it hears nothing for 2 s: whoever wants a light to stay on
/// asks for Report() or SetLight() more often. The destructor sends all off; a killed program sends
/// nothing, and the board's own time-out does it.
///
/// Errors   kDevice: the port is gone, the board restarted, refused, speaks another protocol, or
///          answers what does not fit the command
///          kTimeout: no answer after all tries; what the board does then is not known, but it
///          turns everything off within 2 s
///          kInvalidArgument: a value out of its range or above the light's limit; nothing was sent
/// Cost     set light at 500 kbaud: 15 bytes there, 22 back, 0.74 ms on the wire
class LightBoard {
 public:
  enum class State { kClosed, kReady, kLost, kRestarted };

  explicit LightBoard(std::unique_ptr<BytePort> port, const LightBoardOptions& options = {});
  LightBoard(LightBoard&& other) noexcept;
  LightBoard& operator=(LightBoard&& other) noexcept;
  ~LightBoard();

  [[nodiscard]] State state() const;
  [[nodiscard]] std::string PortName() const;
  // Returns the information from the last Connect that succeeded.
  [[nodiscard]] const BoardInfo& Info() const;
  // Returns the state in the latest answer of this connection, also where it was an error.
  [[nodiscard]] const std::optional<BoardState>& LastSaid() const;

  // Tries until the board has greeted or greeting_timeout has passed. From kClosed a port that is
  // not there is an error at once; from other states it is waited for, at most for `port_wait`,
  // since it may be plugged in again.
  [[nodiscard]] Status Connect(std::chrono::milliseconds port_wait = kUntilGreetingTimeout);
  // Sends all off where the state is kReady, without waiting for the answer.
  void Close() noexcept;
  // Returns the time of the port's clock.
  [[nodiscard]] BytePort::Duration Now() const;
  // Waits by the port's clock; commands are not sent meanwhile.
  void Wait(std::chrono::milliseconds time);

  // Turns the light on, or changes its level, for on_time from now; with `add` the others stay on.
  // Level in [0, 1] in steps of 0.001; 0 turns it off.
  [[nodiscard]] Result<BoardState> SetLight(int channel, double level,
                                            std::chrono::milliseconds on_time, bool add = false);
  [[nodiscard]] Result<BoardState> AllOff();
  [[nodiscard]] Result<BoardReport> Report();
  // Makes the next flash sync turn the light on for on_time, once.
  [[nodiscard]] Result<BoardState> Arm(int channel, double level,
                                       std::chrono::milliseconds on_time);
  [[nodiscard]] Result<BoardState> TriggerShutter(std::chrono::milliseconds press);
  // Both turn everything off and are kept over power cuts; Info() follows.
  [[nodiscard]] Result<BoardState> Limit(int channel, const LightLimits& limits);
  [[nodiscard]] Result<BoardState> Configure(const BoardSettings& settings);
  [[nodiscard]] Result<BoardState> ClearFault(int fault);
  // Makes the firmware of a test build hang after its answer, with interrupts on or off.
  [[nodiscard]] Result<BoardState> Hang(bool interrupts);

 private:
  // Sends the command, and checks its answer against it.
  template <typename Answer, typename Request>
  [[nodiscard]] Result<Answer> Ask(const Request& request, bool slow = false);
  template <typename Request>
  [[nodiscard]] Result<BoardState> Do(const Request& request, bool slow = false);

  Status options_status_;
  std::unique_ptr<BoardLink> link_;  // null once moved from, and then only good to be assigned to
  BoardInfo info_;
  std::optional<BoardState> last_said_;
};

}  // namespace sateen
