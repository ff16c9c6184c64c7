#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/error.h"
#include "simulation/virtual_rig/board/chip.h"

namespace sateen {

// Pins of the board's parts; docs/rig.md, "Wiring".
struct BoardWiring {
  std::vector<ChipPin> lights;  // enable input of light k's driver; high is on
  ChipPin dimming;              // dimming input of all drivers, driven by a timer's compare unit
  int dimming_timer = 1;
  char dimming_unit = 'A';
  std::optional<ChipPin> flash_sync;  // pulled up by the board, closed to ground by the camera
  std::optional<ChipPin> shutter;     // high closes the camera's release contact
};

// Returns the wiring of our firmware for 14 or for 16 lights, from firmware/controller/pins.h.
[[nodiscard]] const BoardWiring& ControllerWiring(int lights = 14);

// From `time` on, `light` shines at `level`, a part of its full power.
struct LightChange {
  SimTime time;
  int light;
  double level;
};

// Record of a light since ClearRecords(). A break of less than 0.1 ms, as while its level changes,
// does not count.
struct ChannelRecord {
  SimTime longest_on{};  // the longest time that it was on without a break, until now
  double highest_level = 0;
  int times_on = 0;
};

// The LED board: a chip that runs the controller's firmware, its lights, and the things around it.
// It knows what really shines, whatever firmware and host believe, which makes it the witness in
// tests and what a virtual camera looks at. Time passes in Run...() only, and as fast as the
// machine can.
class VirtualBoard {
 public:
  // Called from within Run...() and from what acts on the board.
  struct Watcher {
    std::function<void(const LightChange&)> light;
    std::function<void(SimTime time, bool closed)> shutter;
    std::function<void(SimTime time, ResetCause cause)> reset;
    std::function<void(SimTime time, uint8_t byte)> sent;
  };

  // Errors as Chip::Load(). The board has power and starts.
  static Result<std::unique_ptr<VirtualBoard>> Load(const std::filesystem::path& firmware,
                                                    const BoardWiring& wiring = ControllerWiring());

  // Returns what Unwatch() takes.
  int Watch(Watcher watcher);
  void Unwatch(int watch) {
    std::erase_if(watchers_, [&](const auto& w) { return w.first == watch; });
  }

  [[nodiscard]] SimTime Now() const { return chip_->Now(); }
  void RunUntil(SimTime time);
  void RunFor(SimTime duration) { RunUntil(Now() + duration); }
  // Runs in steps of `step` until `done` holds; false if it did not within `limit`.
  bool RunUntil(const std::function<bool()>& done, SimTime limit,
                SimTime step = std::chrono::microseconds(50));

  // Calls `action` when the simulated time has come, within Run...(): for events on the board while
  // somebody waits for it.
  void At(SimTime time, std::function<void()> action) { actions_.emplace(time, std::move(action)); }

  // The serial line. TakeSent() returns what the board has sent since it was last called.
  void Send(std::span<const uint8_t> bytes);
  std::vector<uint8_t> TakeSent() { return std::exchange(sent_, {}); }

  [[nodiscard]] int LightCount() const { return static_cast<int>(levels_.size()); }
  [[nodiscard]] double Level(int light) const { return levels_[static_cast<size_t>(light)]; }
  [[nodiscard]] std::vector<int> Lit() const;
  [[nodiscard]] bool ShutterClosed() const { return shutter_closed_; }
  [[nodiscard]] std::vector<ChannelRecord> Records() const;
  void ClearRecords();

  void Reset(ResetCause cause = ResetCause::kExternal) { chip_->Reset(cause); }
  // Resets as opening the port does on an Uno, with a boot loader that takes its time.
  void ResetByHost(SimTime boot_loader) { chip_->HoldInReset(boot_loader, ResetCause::kExternal); }
  // Keeps the supply voltage too low for `duration`.
  void BrownOut(SimTime duration) { chip_->HoldInReset(duration, ResetCause::kBrownOut); }
  void Unplug() { chip_->PowerOff(); }
  void Plug();
  [[nodiscard]] uint64_t TimesPlugged() const { return times_plugged_; }
  [[nodiscard]] bool Plugged() const { return chip_->HasPower(); }
  [[nodiscard]] bool HasFlashSync() const { return wiring_.flash_sync.has_value(); }
  // Closes the camera's flash contact, or opens it; a board without the input does not notice.
  void FlashSync(bool closed) {
    if (wiring_.flash_sync) {
      chip_->DriveInput(*wiring_.flash_sync, !closed);
    }
  }

  [[nodiscard]] Chip& InnerChip() { return *chip_; }

 private:
  explicit VirtualBoard(BoardWiring wiring);
  void OutputsChanged();
  void SetLevel(size_t light, double level);

  BoardWiring wiring_;
  std::unique_ptr<Chip> chip_;
  std::vector<std::pair<int, Watcher>> watchers_;
  int next_watch_ = 0;
  std::multimap<SimTime, std::function<void()>> actions_;
  std::vector<uint8_t> sent_;
  std::vector<double> levels_;
  std::vector<SimTime> on_since_;
  std::vector<std::optional<SimTime>> off_since_;  // absent for a light that never was on
  std::vector<ChannelRecord> records_;
  bool shutter_closed_ = false;
  uint64_t times_plugged_ = 1;
};

}  // namespace sateen
