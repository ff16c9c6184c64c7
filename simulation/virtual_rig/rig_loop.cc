#include "simulation/virtual_rig/rig_loop.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

namespace sateen {
namespace {

using std::chrono::duration;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::steady_clock;

constexpr microseconds kStep(100);
constexpr microseconds kIdleStep(1000);  // while nobody has the port open
constexpr milliseconds kLongestLag(100);
constexpr std::chrono::seconds kBootLoader(1);

std::string Quoted(const std::string& text) { return nlohmann::json(text).dump(); }

}  // namespace

RigLoop::RigLoop(VirtualBoard& board, VirtualPort& port, RigLoopOptions options)
    : board_(board), port_(port), options_(std::move(options)), start_(steady_clock::now()) {
  for (int k = static_cast<int>(options_.names.size()); k < board_.LightCount(); ++k) {
    options_.names.push_back(fmt::format("channel {}", k));
  }
  watch_ = board_.Watch(
      {.light =
           [this](const LightChange& change) {
             if (options_.light_log != nullptr) {
               options_.light_log->Changed(WallClockAt(change.time), change.light, change.level);
             }
             const std::string& name = options_.names[static_cast<size_t>(change.light)];
             Say(change.time,
                 fmt::format(R"("event":"light","channel":{},"name":{},"level":{:.4g})",
                             change.light, Quoted(name), change.level));
           },
       .shutter =
           [this](SimTime time, bool closed) {
             Say(time, fmt::format(R"("event":"shutter","closed":{})", closed));
           },
       .reset =
           [this](SimTime time, ResetCause cause) {
             Say(time, fmt::format(R"("event":"reset","cause":"{}")", Name(cause)));
           }});
}

void RigLoop::Start(const std::string& firmware, const Environment& environment) {
  start_ = steady_clock::now() - board_.Now();
  Say(board_.Now(),
      fmt::format(R"("event":"start","schema":"sateen.virtual-rig/1","port":{},"terminal":{},)"
                  R"("firmware":{},"lights":{},"environment":{})",
                  Quoted(port_.Name()), Quoted(port_.Terminal()), Quoted(firmware),
                  board_.LightCount(), nlohmann::json(environment).dump()));
}

void RigLoop::Step() {
  const microseconds wait = port_.InUse() ? kStep : kIdleStep;
  board_.Send(port_.Receive(wait, board_.InnerChip().BaudRate()));
  if (options_.opening_resets && port_.InUse() && !was_in_use_) {
    board_.ResetByHost(kBootLoader);
  }
  was_in_use_ = port_.InUse();
  if (flash_ends_ && board_.Now() >= *flash_ends_) {
    flash_ends_.reset();
    board_.FlashSync(false);
  }
  const nanoseconds lag = WallTime() - board_.Now();
  longest_lag_ = std::max(longest_lag_, lag);
  if (lag > kLongestLag) {
    left_out_ += lag;
  }
  board_.RunUntil(WallTime());
  if (options_.light_log != nullptr) {
    options_.light_log->KnownUntil(WallClockAt(board_.Now()));
  }
  port_.Send(board_.TakeSent(), board_.InnerChip().BaudRate());
}

void RigLoop::End() {
  const double wall_s = duration<double>(steady_clock::now() - start_).count();
  Say(board_.Now(), fmt::format(R"("event":"end","wall_s":{:.6f},"longest_lag_s":{:.6f})", wall_s,
                                duration<double>(longest_lag_).count()));
}

std::optional<Result<RigAction>> RigLoop::Parse(const std::string& line) {
  const std::vector<std::string> words = WordsOf(line);
  const std::string verb = words.empty() ? "" : words.front();
  const bool takes_time = verb == "brown-out" || verb == "flash";
  if (!takes_time && verb != "unplug" && verb != "plug" && verb != "reset") {
    return std::nullopt;
  }
  if (const Status count = CheckWordCount(words, 1, takes_time ? 2 : 1, kBoardCommands); !count) {
    return tl::unexpected(count.error());
  }
  const Result<double> ms =
      words.size() > 1 ? NumberIn(words[1], "the time in ms", 0.0, 1e6) : Result<double>(20.0);
  if (!ms) {
    return tl::unexpected(ms.error());
  }
  if (verb == "flash" && !board_.HasFlashSync()) {
    return Fail(ErrorCode::kInvalidArgument, "a board with {} lights has no flash sync",
                board_.LightCount());
  }
  const auto time = std::chrono::duration_cast<SimTime>(duration<double, std::milli>(*ms));
  return RigAction{[this, verb, time] { return Act(verb, time); }, /*on_board=*/true};
}

Status RigLoop::Act(const std::string& verb, SimTime time) {
  if (verb == "plug") {
    board_.Plug();
    if (Status plugged = port_.Plug(); !plugged) {
      return plugged;
    }
    Say(board_.Now(), fmt::format(R"("event":"plug","terminal":{})", Quoted(port_.Terminal())));
  } else if (verb == "unplug") {
    port_.Unplug();
    board_.Unplug();
    Say(board_.Now(), R"("event":"unplug")");
  } else if (verb == "reset") {
    board_.Reset();
  } else if (verb == "brown-out") {
    board_.BrownOut(time);
  } else {
    board_.FlashSync(true);
    flash_ends_ = board_.Now() + time;
  }
  return {};
}

nanoseconds RigLoop::WallTime() const { return steady_clock::now() - start_ - left_out_; }

steady_clock::time_point RigLoop::WallClockAt(SimTime time) const {
  return start_ + left_out_ + time;
}

void RigLoop::Say(SimTime time, const std::string& fields) const {
  if (options_.events != nullptr) {
    fmt::print(options_.events, "{{\"time_s\":{:.6f},{}}}\n", duration<double>(time).count(),
               fields);
    std::fflush(options_.events);
  }
}

}  // namespace sateen
