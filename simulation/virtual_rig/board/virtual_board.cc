#include "simulation/virtual_rig/board/virtual_board.h"

#include <algorithm>
#include <utility>

#include "core/check.h"
#include "firmware/controller/pins.h"

namespace sateen {
namespace {

constexpr SimTime kShortestBreak = std::chrono::microseconds(100);

// pins.h names ports as the firmware's macros need them: B, not 'B'.
#define SATEEN_PIN(port, bit) \
  ChipPin { (#port)[0], bit }
#define SATEEN_PIN_OF(port, bit) SATEEN_PIN(port, bit)  // expands a macro given as argument
#define SATEEN_LIGHT_PIN(channel, port, bit, arduino) SATEEN_PIN(port, bit),

BoardWiring WiringOf14() {
  return {.lights = {SATEEN_LIGHT_PINS_14(SATEEN_LIGHT_PIN)},
          .dimming = SATEEN_PIN_OF(SATEEN_DIM_PORT, SATEEN_DIM_BIT),
          .dimming_timer = 1,
          .dimming_unit = 'A',
          .flash_sync = SATEEN_PIN_OF(SATEEN_SYNC_PORT, SATEEN_SYNC_BIT),
          .shutter = SATEEN_PIN_OF(SATEEN_SHUTTER_PORT, SATEEN_SHUTTER_BIT)};
}

// Adds two more lights on the pins of flash sync and shutter.
BoardWiring WiringOf16() {
  BoardWiring wiring = WiringOf14();
  wiring.lights = {SATEEN_LIGHT_PINS_16(SATEEN_LIGHT_PIN)};
  wiring.flash_sync.reset();
  wiring.shutter.reset();
  return wiring;
}

}  // namespace

const BoardWiring& ControllerWiring(int lights) {
  SATEEN_CHECK(lights == 14 || lights == 16);
  static const BoardWiring k14 = WiringOf14();
  static const BoardWiring k16 = WiringOf16();
  return lights == 14 ? k14 : k16;
}

VirtualBoard::VirtualBoard(BoardWiring wiring)
    : wiring_(std::move(wiring)),
      levels_(wiring_.lights.size()),
      on_since_(wiring_.lights.size()),
      off_since_(wiring_.lights.size()),
      records_(wiring_.lights.size()) {}

Result<std::unique_ptr<VirtualBoard>> VirtualBoard::Load(const std::filesystem::path& firmware,
                                                         const BoardWiring& wiring) {
  std::unique_ptr<VirtualBoard> board(new VirtualBoard(wiring));
  VirtualBoard* self = board.get();
  Result<std::unique_ptr<Chip>> chip =
      Chip::Load(firmware, {.sent =
                                [self](uint8_t byte) {
                                  self->sent_.push_back(byte);
                                  for (const auto& [id, watcher] : self->watchers_) {
                                    if (watcher.sent) {
                                      watcher.sent(self->Now(), byte);
                                    }
                                  }
                                },
                            .outputs_changed = [self] { self->OutputsChanged(); },
                            .reset =
                                [self](ResetCause cause) {
                                  for (const auto& [id, watcher] : self->watchers_) {
                                    if (watcher.reset) {
                                      watcher.reset(self->Now(), cause);
                                    }
                                  }
                                }});
  if (!chip) {
    return tl::unexpected(chip.error());
  }
  board->chip_ = std::move(*chip);
  board->FlashSync(false);
  return board;
}

int VirtualBoard::Watch(Watcher watcher) {
  watchers_.emplace_back(++next_watch_, std::move(watcher));
  return next_watch_;
}

void VirtualBoard::RunUntil(SimTime time) {
  while (!actions_.empty() && actions_.begin()->first <= time) {
    const auto next = actions_.extract(actions_.begin());
    chip_->RunUntil(next.key());
    next.mapped()();
  }
  chip_->RunUntil(time);
}

bool VirtualBoard::RunUntil(const std::function<bool()>& done, SimTime limit, SimTime step) {
  const SimTime end = Now() + limit;
  while (!done()) {
    if (Now() >= end) {
      return false;
    }
    RunUntil(std::min(Now() + step, end));
  }
  return true;
}

void VirtualBoard::Send(std::span<const uint8_t> bytes) {
  for (const uint8_t byte : bytes) {
    chip_->Receive(byte);
  }
}

std::vector<int> VirtualBoard::Lit() const {
  std::vector<int> lit;
  for (int light = 0; light < LightCount(); ++light) {
    if (Level(light) > 0) {
      lit.push_back(light);
    }
  }
  return lit;
}

std::vector<ChannelRecord> VirtualBoard::Records() const {
  std::vector<ChannelRecord> records = records_;
  for (size_t k = 0; k < records.size(); ++k) {
    if (levels_[k] > 0) {
      records[k].longest_on = std::max(records[k].longest_on, Now() - on_since_[k]);
    }
  }
  return records;
}

void VirtualBoard::ClearRecords() {
  for (size_t k = 0; k < records_.size(); ++k) {
    records_[k] = {.highest_level = levels_[k]};
  }
}

void VirtualBoard::Plug() {
  if (!Plugged()) {
    ++times_plugged_;
    chip_->PowerOn();
  }
}

void VirtualBoard::OutputsChanged() {
  if (chip_ == nullptr) {
    return;  // the chip's very first reset
  }
  double dimming = chip_->Drives(wiring_.dimming) ? 1.0 : 0.0;
  if (const double duty = chip_->Duty(wiring_.dimming_timer, wiring_.dimming_unit); duty >= 0) {
    dimming = duty;
  }
  for (size_t k = 0; k < wiring_.lights.size(); ++k) {
    SetLevel(k, chip_->Drives(wiring_.lights[k]) ? dimming : 0);
  }
  const bool closed = wiring_.shutter && chip_->Drives(*wiring_.shutter);
  if (closed != shutter_closed_) {
    shutter_closed_ = closed;
    for (const auto& [id, watcher] : watchers_) {
      if (watcher.shutter) {
        watcher.shutter(Now(), closed);
      }
    }
  }
}

void VirtualBoard::SetLevel(size_t light, double level) {
  if (level == levels_[light]) {
    return;
  }
  ChannelRecord& record = records_[light];
  if (levels_[light] == 0) {
    if (!off_since_[light] || Now() - *off_since_[light] >= kShortestBreak) {
      on_since_[light] = Now();
      ++record.times_on;
    }
  } else if (level == 0) {
    off_since_[light] = Now();
    record.longest_on = std::max(record.longest_on, Now() - on_since_[light]);
  }
  levels_[light] = level;
  record.highest_level = std::max(record.highest_level, level);
  for (const auto& [id, watcher] : watchers_) {
    if (watcher.light) {
      watcher.light({.time = Now(), .light = static_cast<int>(light), .level = level});
    }
  }
}

}  // namespace sateen
