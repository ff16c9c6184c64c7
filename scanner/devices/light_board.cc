#include "scanner/devices/light_board.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "scanner/devices/board_answer.h"
#include "scanner/devices/board_link.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;

double LevelOf(unsigned permille) { return permille / double{SATEEN_FULL_LEVEL}; }

std::string ResetText(unsigned causes) {
  std::string text;
#define SATEEN_RESET_TEXT(NAME, bit, words) \
  if ((causes & (bit)) != 0) {              \
    text += (text.empty() ? "" : " and ");  \
    text += (words);                        \
  }
  SATEEN_RESET_CAUSES(SATEEN_RESET_TEXT)
#undef SATEEN_RESET_TEXT
  return text.empty() ? "unknown: the bootloader does not say" : text;
}

BoardState StateOf(const SateenState& answer) {
  return {.fault = answer.fault,
          .lit = answer.lit,
          .level = LevelOf(answer.level_permille),
          .lit_for = milliseconds(answer.lit_ms),
          .left = milliseconds(answer.left_ms),
          .armed = answer.armed == SATEEN_NO_CHANNEL ? -1 : answer.armed,
          .shutter = milliseconds(answer.shutter_ms)};
}

// Returns the fields of a report that it shares with a state.
SateenState SharedFields(const SateenState& answer) { return answer; }
SateenState SharedFields(const SateenReport& answer) {
  return {.request = answer.request,
          .result = answer.result,
          .fault = answer.fault,
          .lit = answer.lit,
          .level_permille = answer.level_permille,
          .lit_ms = answer.lit_ms,
          .left_ms = answer.left_ms,
          .armed = answer.armed,
          .shutter_ms = answer.shutter_ms};
}

BoardInfo InfoOf(const SateenGreeting& greeting) {
  BoardInfo info = {
      .protocol = fmt::format("{}.{}", greeting.protocol_major, greeting.protocol_minor),
      .build_id = std::string(std::begin(greeting.build_id), std::end(greeting.build_id)),
      .settings = {.max_lit = greeting.max_lit,
                   .dim_clock = greeting.dim_clock,
                   .sync_rising = greeting.sync_edge != 0},
      .silence = milliseconds(greeting.silence_ms),
      .reset_cause = ResetText(greeting.reset_cause),
      .fault = greeting.fault};
  for (int channel = 0; channel < greeting.channels; ++channel) {
    info.lights.push_back({.max_level = LevelOf(greeting.max_level_permille[channel]),
                           .max_on = milliseconds(greeting.max_on_ms[channel])});
  }
  return info;
}

Status CheckChannel(int channel, const BoardInfo& info) {
  const int channels = static_cast<int>(info.lights.size());
  if (channel < 0 || channel >= channels) {
    return Fail(ErrorCode::kInvalidArgument, "light {}: the board has lights 0 to {}", channel,
                channels - 1);
  }
  return {};
}

// Fails unless the level is in [0, 1] and not so small that rounding to thousandths makes it 0. NaN
// fails.
Status CheckLevel(double level) {
  if (!(level >= 0.0 && level <= 1.0) || (level > 0.0 && level < 0.5 / SATEEN_FULL_LEVEL)) {
    return Fail(ErrorCode::kInvalidArgument,
                "level {} is out of range; needs 0, or 0.001 to 1 (0.1 % to 100 %)", level);
  }
  return {};
}

std::uint16_t PermilleOf(double level) {
  return static_cast<std::uint16_t>(std::lround(level * SATEEN_FULL_LEVEL));
}

// Checks everything that the board would refuse for its limits, in words that name the light.
Status CheckLight(int channel, double level, milliseconds on_time, const BoardInfo& info) {
  Status valid = CheckChannel(channel, info);
  if (valid) {
    valid = CheckLevel(level);
  }
  if (!valid) {
    return valid;
  }
  const LightLimits& limits = info.lights[static_cast<std::size_t>(channel)];
  if (PermilleOf(level) > PermilleOf(limits.max_level)) {
    return Fail(ErrorCode::kInvalidArgument,
                "light {}: level {:.1f} % is above its limit of {:.1f} %; 'sateen light limits' "
                "sets limits",
                channel, 100.0 * level, 100.0 * limits.max_level);
  }
  if (on_time < milliseconds(1) || on_time > limits.max_on) {
    return Fail(ErrorCode::kInvalidArgument,
                "light {}: on-time of {} ms is not in 1 ms to its limit of {} ms; 'sateen light "
                "limits' sets limits",
                channel, on_time.count(), limits.max_on.count());
  }
  return {};
}

}  // namespace

std::string FaultText(int fault) {
  switch (fault) {
#define SATEEN_FAULT_TEXT(NAME, number, text) \
  case number:                                \
    return text;
    SATEEN_FAULTS(SATEEN_FAULT_TEXT)
#undef SATEEN_FAULT_TEXT
    default:
      return fmt::format("fault {}, which this program does not know", fault);
  }
}

std::vector<int> LitChannels(unsigned lit) {
  std::vector<int> channels;
  for (int channel = 0; lit >> channel != 0; ++channel) {
    if ((lit >> channel & 1U) != 0) {
      channels.push_back(channel);
    }
  }
  return channels;
}

std::string LightsText(unsigned lit) {
  const std::vector<int> channels = LitChannels(lit);
  if (channels.empty()) {
    return "no light";
  }
  std::string text = channels.size() == 1 ? "light " : "lights ";
  for (std::size_t k = 0; k < channels.size(); ++k) {
    text += k == 0 ? "" : k + 1 == channels.size() ? " and " : ", ";
    text += std::to_string(channels[k]);
  }
  return text;
}

Status LightBoardOptions::Validate() const {
  if (answer_timeout < milliseconds(1)) {
    return Fail(ErrorCode::kInvalidArgument, "answer_timeout is {} ms; needs at least 1 ms",
                answer_timeout.count());
  }
  if (tries < 1) {
    return Fail(ErrorCode::kInvalidArgument, "tries is {}; needs at least 1", tries);
  }
  if (greeting_timeout < milliseconds(1)) {
    return Fail(ErrorCode::kInvalidArgument, "greeting_timeout is {} ms; needs at least 1 ms",
                greeting_timeout.count());
  }
  return {};
}

LightBoard::LightBoard(std::unique_ptr<BytePort> port, const LightBoardOptions& options)
    : options_status_(options.Validate()),
      link_(std::make_unique<BoardLink>(std::move(port), options)) {}

LightBoard::LightBoard(LightBoard&& other) noexcept = default;

LightBoard& LightBoard::operator=(LightBoard&& other) noexcept {
  if (this != &other) {
    Close();
    options_status_ = std::move(other.options_status_);
    link_ = std::move(other.link_);
    info_ = std::move(other.info_);
    last_said_ = other.last_said_;
  }
  return *this;
}

LightBoard::~LightBoard() { Close(); }

LightBoard::State LightBoard::state() const {
  return link_ == nullptr ? State::kClosed : link_->state();
}

std::string LightBoard::PortName() const { return link_ == nullptr ? "" : link_->port().Name(); }

const BoardInfo& LightBoard::Info() const { return info_; }

const std::optional<BoardState>& LightBoard::LastSaid() const { return last_said_; }

Status LightBoard::Connect(milliseconds port_wait) {
  if (!options_status_) {
    return options_status_;
  }
  const Result<SateenGreeting> greeting = link_->Connect(port_wait);
  if (!greeting) {
    return tl::unexpected(greeting.error());
  }
  info_ = InfoOf(*greeting);
  last_said_.reset();
  return {};
}

void LightBoard::Close() noexcept {
  if (link_ != nullptr) {
    link_->Close();
  }
}

BytePort::Duration LightBoard::Now() const { return link_->port().Now(); }

void LightBoard::Wait(milliseconds time) { link_->port().Wait(time); }

template <typename Answer, typename Request>
Result<Answer> LightBoard::Ask(const Request& request, bool slow) {
  const BytePort::Duration sent = link_->port().Now();
  Result<Answer> answer = link_->Command<Answer>(request, slow);
  if (!answer) {
    return answer;
  }
  const SateenState said = SharedFields(*answer);
  last_said_ = StateOf(said);
  using Message = BoardMessage<Request>;
  if (const Status done = link_->CheckDone(Message::kName, Message::kId, said); !done) {
    return tl::unexpected(done.error());
  }
  const std::string contradiction =
      Contradiction(request, said, {.board = info_, .took = link_->port().Now() - sent});
  if (!contradiction.empty()) {
    return Fail(ErrorCode::kDevice,
                "{}: told '{}', the board says that {}{}; look at the lights, cut their supply if "
                "one is on, and see whether the board has Sateen's firmware",
                PortName(), BoardLink::Words(Message::kName), contradiction,
                said.fault == SATEEN_FAULT_NONE
                    ? ""
                    : fmt::format(" (fault {}: {})", said.fault, FaultText(said.fault)));
  }
  return answer;
}

template <typename Request>
Result<BoardState> LightBoard::Do(const Request& request, bool slow) {
  return Ask<SateenState>(request, slow).map([](const SateenState& said) { return StateOf(said); });
}

Result<BoardState> LightBoard::SetLight(int channel, double level, milliseconds on_time, bool add) {
  if (const Status valid = CheckLevel(level); !valid) {
    return tl::unexpected(valid.error());
  }
  if (state() == State::kReady) {
    const milliseconds checked = level == 0.0 ? milliseconds(1) : on_time;
    if (const Status valid = CheckLight(channel, level, checked, info_); !valid) {
      return tl::unexpected(valid.error());
    }
  }
  return Do(SateenSetLight{.channel = static_cast<std::uint8_t>(channel),
                           .level_permille = PermilleOf(level),
                           .on_ms = static_cast<std::uint16_t>(on_time.count()),
                           .add = static_cast<std::uint8_t>(add)});
}

Result<BoardState> LightBoard::AllOff() { return Do(SateenAllOff{}); }

Result<BoardReport> LightBoard::Report() {
  const Result<SateenReport> report = Ask<SateenReport>(SateenStatus{});
  if (!report) {
    return tl::unexpected(report.error());
  }
  return BoardReport{.state = StateOf(SharedFields(*report)),
                     .reset_cause = ResetText(report->reset_cause),
                     .uptime = milliseconds(report->uptime_ms),
                     .frames = report->frames,
                     .bad_frames = report->bad_frames,
                     .overruns = report->overruns,
                     .refused = report->refused,
                     .repeats = report->repeats,
                     .unsent = report->unsent,
                     .syncs = report->syncs,
                     .flashes = report->flashes,
                     .faults = report->faults};
}

Result<BoardState> LightBoard::Arm(int channel, double level, milliseconds on_time) {
  Status valid = CheckLevel(level);
  if (valid && state() == State::kReady) {
    valid = CheckLight(channel, level, on_time, info_);
  }
  if (valid && level == 0.0) {
    valid =
        Fail(ErrorCode::kInvalidArgument, "light {}: a flash needs a level of 0.001 to 1", channel);
  }
  if (!valid) {
    return tl::unexpected(valid.error());
  }
  return Do(SateenArm{.channel = static_cast<std::uint8_t>(channel),
                      .level_permille = PermilleOf(level),
                      .on_ms = static_cast<std::uint16_t>(on_time.count())});
}

Result<BoardState> LightBoard::TriggerShutter(milliseconds press) {
  if (press < milliseconds(1) || press > milliseconds(SATEEN_LONGEST_PRESS_MS)) {
    return Fail(ErrorCode::kInvalidArgument, "shutter press of {} ms; needs 1 to {} ms",
                press.count(), SATEEN_LONGEST_PRESS_MS);
  }
  return Do(SateenTriggerShutter{.press_ms = static_cast<std::uint16_t>(press.count())});
}

Result<BoardState> LightBoard::Limit(int channel, const LightLimits& limits) {
  Status valid = state() == State::kReady ? CheckChannel(channel, info_) : Status{};
  if (valid) {
    valid = CheckLevel(limits.max_level);
  }
  if (valid &&
      (limits.max_on < milliseconds(1) || limits.max_on > milliseconds(SATEEN_LONGEST_ON_MS))) {
    valid =
        Fail(ErrorCode::kInvalidArgument, "light {}: longest on-time of {} ms; needs 1 to {} ms",
             channel, limits.max_on.count(), SATEEN_LONGEST_ON_MS);
  }
  if (!valid) {
    return tl::unexpected(valid.error());
  }
  Result<BoardState> answer =
      Do(SateenLimitLight{.channel = static_cast<std::uint8_t>(channel),
                          .max_level_permille = PermilleOf(limits.max_level),
                          .max_on_ms = static_cast<std::uint16_t>(limits.max_on.count())},
         /*slow=*/true);
  if (answer) {
    info_.lights[static_cast<std::size_t>(channel)] = {
        .max_level = LevelOf(PermilleOf(limits.max_level)), .max_on = limits.max_on};
  }
  return answer;
}

Result<BoardState> LightBoard::Configure(const BoardSettings& settings) {
  const int channels = static_cast<int>(info_.lights.size());
  if (state() == State::kReady && (settings.max_lit < 1 || settings.max_lit > channels ||
                                   settings.dim_clock < 0 || settings.dim_clock > 2)) {
    return Fail(ErrorCode::kInvalidArgument,
                "max_lit {} needs 1 to {}, and dim_clock {} needs 0 to 2", settings.max_lit,
                channels, settings.dim_clock);
  }
  Result<BoardState> answer =
      Do(SateenConfigure{.max_lit = static_cast<std::uint8_t>(settings.max_lit),
                         .dim_clock = static_cast<std::uint8_t>(settings.dim_clock),
                         .sync_edge = static_cast<std::uint8_t>(settings.sync_rising)},
         /*slow=*/true);
  if (answer) {
    info_.settings = settings;
  }
  return answer;
}

Result<BoardState> LightBoard::ClearFault(int fault) {
  return Do(SateenClearFault{.fault = static_cast<std::uint8_t>(fault)});
}

Result<BoardState> LightBoard::Hang(bool interrupts) {
  return Do(SateenHang{.interrupts = static_cast<std::uint8_t>(interrupts)});
}

}  // namespace sateen
