#include "scanner/daemon/light_job.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;

// Often enough for the board's 2 s of silence, and for noticing at once that a light went off.
constexpr milliseconds kKeepAlive{250};
// How soon a cancelled task is noticed.
constexpr milliseconds kCancelStep{50};

// Record of a light until it went off, by itself or because the task was cancelled.
struct Lit {
  bool cancelled = false;
  milliseconds lasted{0};  // by this program's clock
  int fault = 0;
};

Result<Lit> StayUntilOff(LightBoard& board, int channel, const Task& task) {
  Lit lit;
  const BytePort::Duration began = board.Now();
  while (true) {
    for (milliseconds waited{0}; waited < kKeepAlive && !task.Cancelled(); waited += kCancelStep) {
      board.Wait(kCancelStep);
    }
    lit.lasted = std::chrono::ceil<milliseconds>(board.Now() - began);
    if (task.Cancelled()) {
      lit.cancelled = true;
      return board.AllOff().map([&](const BoardState&) { return lit; });
    }
    const Result<BoardReport> report = board.Report();
    if (!report) {
      return tl::unexpected(report.error());
    }
    const BoardState& state = report->state;
    lit.fault = state.fault;
    if (state.lit == 0) {
      return lit;
    }
    if (state.lit != 1U << static_cast<unsigned>(channel)) {
      return Fail(ErrorCode::kDevice, "{}: light {} should be on alone, but the board says: {}",
                  board.PortName(), channel, LightsText(state.lit));
    }
  }
}

// Returns "500 ms" below a second, else the time in seconds.
std::string OnTimeText(milliseconds time) {
  return time < milliseconds(1000)
             ? fmt::format("{} ms", time.count())
             : fmt::format("{:g} s", static_cast<double>(time.count()) / 1000.0);
}

}  // namespace

Result<bool> KeepLightOn(const LightRequest& request, LightBoard& board, const Task& task,
                         const std::function<void(const LightOn&)>& began) {
  const int channel = request.channel;
  const auto index = static_cast<std::size_t>(channel);
  const bool known = channel >= 0 && index < board.Info().lights.size();
  const milliseconds on_time =
      request.on_time.value_or(known ? board.Info().lights[index].max_on : milliseconds(1));
  const Result<BoardState> on = board.SetLight(channel, request.level, on_time);
  if (!on) {
    return tl::unexpected(on.error());
  }
  if (request.level == 0.0) {
    return false;
  }
  began({.level = on->level, .on_time = on_time});
  const Result<Lit> lit = StayUntilOff(board, channel, task);
  if (!lit) {
    return tl::unexpected(lit.error());
  }
  const std::string name = request.name.empty() ? std::to_string(channel) : request.name;
  if (lit->fault != on->fault && lit->fault != 0) {
    return Fail(ErrorCode::kDevice, "light {} went off: fault {}: {}", name, lit->fault,
                FaultText(lit->fault));
  }
  if (!lit->cancelled && !request.on_time) {
    return Fail(
        ErrorCode::kDevice,
        "light {} went off after {}, the longest that it may be on; if the LED bears more on its "
        "heat sink, raise that by 'sateen light limits {} --max-on TIME'",
        name, OnTimeText(on_time), name);
  }
  if (!lit->cancelled && lit->lasted + kKeepAlive < on_time) {
    return Fail(ErrorCode::kDevice,
                "light {} went off after {} at most, by itself; it was to be on for {}", name,
                OnTimeText(lit->lasted), OnTimeText(on_time));
  }
  return lit->cancelled;
}

}  // namespace sateen
