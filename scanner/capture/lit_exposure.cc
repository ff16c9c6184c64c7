#include "scanner/capture/lit_exposure.h"

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "core/stopwatch.h"
#include "core/whole_number.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;

// Talks to the board while the camera exposes, so that it keeps the light on, and turns the light
// off at once if the capture is cancelled. Nobody else uses the board until Stop().
class KeepAlive {
 public:
  KeepAlive(LightBoard& board, milliseconds interval, const Task& task)
      : board_(board), interval_(interval), task_(task) {
    if (interval_ > milliseconds(0)) {
      thread_ = std::thread([this] { Run(); });
    }
  }
  KeepAlive(const KeepAlive&) = delete;
  KeepAlive& operator=(const KeepAlive&) = delete;
  ~KeepAlive() { Join(); }

  Status Stop() {
    Join();
    return status_;
  }

 private:
  static constexpr milliseconds kStep{50};  // how soon a cancellation is heard

  void Join() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
    }
    stop_.notify_all();
    if (thread_.joinable()) {
      thread_.join();
    }
  }

  void Run() {
    milliseconds silent{0};
    std::unique_lock lock(mutex_);
    while (!stop_.wait_for(lock, kStep, [&] { return stopped_; })) {
      silent += kStep;
      if (task_.Cancelled()) {
        // The board's answer is asked for again when the camera has ended.
        [[maybe_unused]] const Result<BoardState> ignored = board_.AllOff();
        return;
      }
      if (silent >= interval_) {
        silent = milliseconds(0);
        if (const Result<BoardReport> report = board_.Report(); !report) {
          status_ = tl::unexpected(report.error());
          return;
        }
      }
    }
  }

  LightBoard& board_;
  milliseconds interval_;
  const Task& task_;
  std::mutex mutex_;  // for stopped_
  std::condition_variable stop_;
  bool stopped_ = false;
  Status status_;
  std::thread thread_;
};

// Fails unless the board says that this light alone is on, or none.
Status ConfirmLit(const std::optional<Light>& light, const BoardState& state, const char* when) {
  const unsigned wanted = light ? 1U << static_cast<unsigned>(light->channel) : 0U;
  if (state.lit == wanted) {
    return {};
  }
  const std::string what = light ? fmt::format("light '{}' alone", light->name) : "no light";
  return Fail(ErrorCode::kDevice,
              "{} should be on {}, but the board says that channels {:#06x} are{}", what, when,
              state.lit,
              state.fault != 0 ? fmt::format(" (fault {}: {})", state.fault, FaultText(state.fault))
              : light && state.lit == 0 ? "; did the camera take longer than --margin allows?"
                                        : "");
}

milliseconds OnTime(const LightBoard& board, const LitExposure& exposure,
                    const CaptureOptions& options) {
  const milliseconds shutter(ClampedTo<int>(std::ceil(1000.0 * exposure.exposure_s)));
  const milliseconds wanted = options.settle + shutter + options.margin;
  const auto channel = static_cast<std::size_t>(exposure.light->channel);
  const std::vector<LightLimits>& limits = board.Info().lights;
  return channel < limits.size() ? std::min(wanted, limits[channel].max_on) : wanted;
}

// Does step 1.
Status TurnOnAlone(LightBoard& board, const LitExposure& exposure, const CaptureOptions& options) {
  const Result<BoardState> state = exposure.light
                                       ? board.SetLight(exposure.light->channel, exposure.level,
                                                        OnTime(board, exposure, options))
                                       : board.AllOff();
  return state ? ConfirmLit(exposure.light, *state, "before the exposure")
               : tl::unexpected(state.error());
}

// Steps 1 to 3.
Result<LitFrame> ExposeUnder(LightBoard& board, TetheredCamera& camera, const LitExposure& exposure,
                             const CaptureOptions& options, const std::filesystem::path& folder,
                             const Task& task) {
  if (const Status lit = TurnOnAlone(board, exposure, options); !lit) {
    return tl::unexpected(lit.error());
  }
  board.Wait(options.settle);
  KeepAlive keep_alive(board, options.keep_alive, task);
  const milliseconds shutter(ClampedTo<int>(std::ceil(1000.0 * exposure.exposure_s)));
  const Stopwatch stopwatch;
  Result<CapturedFile> file = camera.Capture(folder, shutter + options.deadline);
  const double camera_s = stopwatch.Seconds();
  const Status kept = keep_alive.Stop();
  if (task.Cancelled()) {
    return Fail(ErrorCode::kCancelled, "cancelled while the camera exposed");
  }
  if (!file) {
    return tl::unexpected(file.error());
  }
  const Result<BoardReport> report = kept.and_then([&] { return board.Report(); });
  if (!report) {
    return tl::unexpected(report.error());
  }
  return ConfirmLit(exposure.light, report->state, "until the camera had delivered").map([&] {
    return LitFrame{*std::move(file), camera_s};
  });
}

}  // namespace

Result<LitFrame> ExposeLit(LightBoard& board, TetheredCamera& camera, const LitExposure& exposure,
                           const CaptureOptions& options, const std::filesystem::path& folder,
                           const Task& task) {
  if (const Status going = task.CheckCancelled(); !going) {
    return tl::unexpected(going.error());
  }
  if (board.state() != LightBoard::State::kReady) {
    if (const Status connected = board.Connect(); !connected) {
      return tl::unexpected(connected.error());
    }
  }
  Result<LitFrame> frame = ExposeUnder(board, camera, exposure, options, folder, task);
  const Status dark = ConfirmDark(board);
  if (dark) {
    return frame;
  }
  return frame ? Result<LitFrame>(tl::unexpected(dark.error()))
               : Fail(frame.error().code == ErrorCode::kCancelled ? dark.error().code
                                                                  : frame.error().code,
                      "{}; and then: {}", frame.error().message, dark.error().message);
}

Status ConfirmDark(LightBoard& board) {
  if (board.state() == LightBoard::State::kClosed) {
    return {};
  }
  return board.AllOff().map([](const BoardState&) {});
}

double LongestExposure(const BoardInfo& board, const Light& light, const CaptureOptions& options) {
  const auto channel = static_cast<std::size_t>(light.channel);
  if (channel >= board.lights.size()) {
    return 0.0;
  }
  const milliseconds on = board.lights[channel].max_on - options.settle;
  return 1e-3 * static_cast<double>((on - std::min(options.margin, on / 2)).count());
}

}  // namespace sateen
