#include "simulation/virtual_rig/board/line_stress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <utility>

#include "scanner/devices/light_board.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;

constexpr int kConnectTries = 20;
constexpr milliseconds kOnTime(2000);

// A light and its level in thousandths.
struct Asked {
  int light;
  int permille;
};

int Permille(double level) { return static_cast<int>(std::lround(level * 1000)); }

class Stress {
 public:
  Stress(VirtualBoard& board, const LineStressOptions& options)
      : board_(board), options_(options), random_(options.seed) {
    auto port = std::make_unique<SimulatedPort>(board, options.faults);
    port_ = port.get();
    host_.emplace(std::move(port));
    watch_ = board_.Watch({.light = [this](const LightChange& change) { Witness(change); }});
  }
  Stress(const Stress&) = delete;
  Stress& operator=(const Stress&) = delete;
  ~Stress() { board_.Unwatch(watch_); }

  Result<LineStressResult> Run(const Task& task) {
    const SimTime start = board_.Now();
    if (const Status connected = Connect(); !connected) {
      return tl::unexpected(connected.error());
    }
    board_.ClearRecords();
    task.BeginStage("stress", static_cast<int>(options_.commands));
    for (result_.commands = 0; result_.commands < options_.commands; ++result_.commands) {
      if (const Status going = task.CheckCancelled(); !going) {
        return tl::unexpected(going.error());
      }
      if (const Status ready = OneCommand(); !ready) {
        return tl::unexpected(ready.error());
      }
      task.Advance();
    }
    Finish(start);
    return std::move(result_);
  }

 private:
  Status Connect() {
    asked_.reset();
    Status connected;
    for (int i = 0; i < kConnectTries; ++i) {
      if (connected = host_->Connect(); connected) {
        return connected;
      }
    }
    return connected;
  }

  Status OneCommand() {
    const SimTime start = board_.Now();
    const uint64_t choice = random_() % 10;
    Result<BoardState> state;
    if (choice < 6) {
      asked_ = {.light = static_cast<int>(random_() % static_cast<uint64_t>(board_.LightCount())),
                .permille = static_cast<int>(random_() % 1000 + 1)};
      asked_at_ = start;
      state = host_->SetLight(asked_->light, asked_->permille / 1000.0, kOnTime);
    } else if (choice < 8) {
      asked_.reset();
      state = host_->AllOff();
    } else if (const Result<BoardReport> report = host_->Report(); report) {
      state = report->state;
      result_.bad_frames = report->bad_frames;
      result_.repeats = report->repeats;
    } else {
      state = tl::unexpected(report.error());
    }
    result_.longest_command = std::max(result_.longest_command, board_.Now() - start);
    if (state) {
      ++result_.done;
      Compare(*state);
      return {};
    }
    ++result_.reported_failed;
    ++result_.reconnects;
    return Connect();
  }

  // Called at the simulated moment at which a light changes.
  void Witness(const LightChange& change) {
    if (change.level > 0 &&
        (!asked_ || asked_->light != change.light || asked_->permille != Permille(change.level))) {
      ++result_.wrong_light;
      Note(fmt::format("light {} went on at {:.3f}; {}", change.light, change.level, AskedText()));
    }
  }

  // The answer of a command that is done says what shines, and that is what was asked for.
  void Compare(const BoardState& state) {
    unsigned lit = 0;
    for (const int light : board_.Lit()) {
      lit |= 1U << light;
    }
    const unsigned wanted = asked_ ? 1U << asked_->light : 0;
    const bool may_have_run_out = board_.Now() - asked_at_ > kOnTime - milliseconds(2);
    const auto right = [&](unsigned mask) {
      return mask == wanted || (mask == 0 && may_have_run_out);
    };
    if (!right(lit) || !right(state.lit) || (lit & ~state.lit) != 0) {
      ++result_.wrong_answer;
      Note(fmt::format("lit {:#x}, answer {:#x}; {}", lit, state.lit, AskedText()));
    }
  }

  [[nodiscard]] std::string AskedText() const {
    return asked_ ? fmt::format("asked for light {} at {:.3f}", asked_->light,
                                asked_->permille / 1000.0)
                  : "asked for none";
  }

  void Note(std::string text) {
    if (result_.first_wrong.empty()) {
      result_.first_wrong = fmt::format("command {}: {}", result_.commands, text);
    }
  }

  void Finish(SimTime start) {
    const std::vector<ChannelRecord> records = board_.Records();
    for (size_t k = 0; k < records.size(); ++k) {
      result_.over_time += records[k].longest_on > host_->Info().lights[k].max_on ? 1 : 0;
    }
    result_.line = port_->Faults();
    result_.simulated = board_.Now() - start;
  }

  VirtualBoard& board_;
  LineStressOptions options_;
  std::mt19937_64 random_;
  int watch_ = 0;
  SimulatedPort* port_ = nullptr;
  std::optional<LightBoard> host_;
  std::optional<Asked> asked_;
  SimTime asked_at_{};
  LineStressResult result_;
};

}  // namespace

Result<LineStressResult> RunLineStress(VirtualBoard& board, const LineStressOptions& options,
                                       const Task& task) {
  if (const Status valid = options.faults.Validate(); !valid) {
    return tl::unexpected(valid.error());
  }
  return Stress(board, options).Run(task);
}

}  // namespace sateen
