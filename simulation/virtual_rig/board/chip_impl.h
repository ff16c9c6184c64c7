#pragma once

// The part of Chip that knows libsimavr; for chip.cc and chip_impl.cc alone.
#include <simavr/avr_eeprom.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <optional>

#include "simulation/virtual_rig/board/chip.h"

namespace sateen {

constexpr std::array kChipPorts = {'B', 'C', 'D'};
// RAM begins here, and this is what a loss of power leaves in it.
constexpr size_t kChipRamStart = 0x100;
constexpr uint8_t kRamAfterPowerLoss = 0xA5;

struct Chip::Impl {
  struct Port {
    Impl* chip = nullptr;
    uint8_t output = 0;     // register PORTx
    uint8_t direction = 0;  // register DDRx
    avr_ioport_external_t driven = {};
  };

  avr_t* avr = nullptr;
  avr_uart_t* uart = nullptr;
  avr_eeprom_t* eeprom = nullptr;
  avr_irq_t* receiver = nullptr;
  void (*reset_of_model)(avr_t*) = nullptr;
  Events events;
  uint64_t cycles_off = 0;  // cycles that passed while it did not run
  bool has_power = true;
  struct Start {
    uint64_t cycle;
    ResetCause cause;
  };
  std::optional<Start> held_until;
  BootLoader boot_loader = BootLoader::kNone;
  // Causes of the resets so far that the firmware has not cleared.
  uint8_t mcusr = 0;
  // Cause of the reset under way; the watchdog's come by themselves.
  ResetCause cause = ResetCause::kWatchdog;
  std::array<Port, kChipPorts.size()> ports = {};
  std::deque<uint8_t> line;
  bool line_busy = false;
  int byte_times_waited = 0;
  uint64_t bytes_lost = 0;

  ~Impl() {
    if (avr != nullptr) {
      avr_terminate(avr);
      std::free(avr);
    }
  }

  // Hooks of libsimavr.
  static void OnReset(avr_t* avr);
  static avr_cycle_count_t OnStart(avr_t* avr, avr_cycle_count_t when, void* chip);
  static void OnPortWrite(avr_irq_t* irq, uint32_t value, void* port);
  static void OnDirectionWrite(avr_irq_t* irq, uint32_t value, void* port);
  static void OnTimerWrite(avr_irq_t* irq, uint32_t value, void* chip);
  static void OnMcusrWrite(avr_irq_t* irq, uint32_t value, void* chip);
  static void OnSent(avr_irq_t* irq, uint32_t value, void* chip);
  static avr_cycle_count_t OnByteTime(avr_t* avr, avr_cycle_count_t when, void* chip);
  static avr_cycle_count_t OnStop(avr_t* /*avr*/, avr_cycle_count_t /*when*/, void* /*chip*/) {
    return 0;
  }

  void Connect();
  void OutputsChanged() const {
    if (events.outputs_changed) {
      events.outputs_changed();
    }
  }
  void ReleaseOutputs();
  void ApplyInputs();
  void Reset(ResetCause why);
  void PutOnLine();
  [[nodiscard]] bool Runs() const { return has_power && !held_until; }
  void Stop();
  void RunCpu(uint64_t end);
  void SpoilRam() const {
    std::fill(avr->data + kChipRamStart, avr->data + avr->ramend + 1, kRamAfterPowerLoss);
  }
  [[nodiscard]] uint64_t Cycle() const { return avr->cycle + cycles_off; }
  [[nodiscard]] uint32_t Word(uint16_t low) const {
    return avr->data[low] | static_cast<uint32_t>(avr->data[low + 1]) << 8;
  }
  struct Waveform {
    bool runs;  // has a clock
    bool fast;  // fast PWM: high from 0 to the compare value, both included; else phase correct
    uint32_t top;
  };
  [[nodiscard]] Waveform WaveformOf(size_t timer) const;
  [[nodiscard]] double Duty(size_t timer, char unit) const;
};

}  // namespace sateen
