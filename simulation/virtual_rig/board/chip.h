#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

// Simulated time since the first power-on. It never runs backwards, whatever is reset.
using SimTime = std::chrono::nanoseconds;

// The bit of MCUSR that tells the firmware why it starts.
enum class ResetCause : uint8_t { kPowerOn = 1, kExternal = 2, kBrownOut = 4, kWatchdog = 8 };
[[nodiscard]] std::string_view Name(ResetCause cause);

// A bit of port B, C or D; PB1 is {'B', 1}.
struct ChipPin {
  char port = 'B';
  int bit = 0;

  friend bool operator==(const ChipPin&, const ChipPin&) = default;
};

// How much of a reset's cause the firmware learns behind a boot loader, which clears MCUSR.
// Optiboot from version 5 on leaves the cause in register r2; others leave nothing.
enum class BootLoader : uint8_t { kNone, kTellsInR2, kTellsNothing };

// An ATmega328P at 16 MHz that runs a firmware image, as libsimavr simulates it. Deterministic: the
// same calls give the same bytes and pins at the same simulated time, and nothing depends on the
// wall clock.
//
// Behaviour missing from libsimavr is added here, because the lights depend on it: outputs are
// released at every reset (it clears the registers and tells nobody), MCUSR tells the cause, time
// goes on without power, and bytes arrive one after the other at the speed of the line.
//
// Not simulated: the code of a boot loader (the image starts at the reset vector), analogue inputs,
// the drift of clock and watchdog oscillator, framing errors. A byte takes 11 bit times, not 10.
class Chip {
 public:
  static constexpr double kClockHz = 16e6;

  // Called while the chip runs, at the simulated time that Now() then tells. May be empty.
  struct Events {
    std::function<void(uint8_t byte)> sent;       // a byte leaves the UART
    std::function<void()> outputs_changed;        // Drives() or Duty() may have a new value
    std::function<void(ResetCause cause)> reset;  // outputs are released already
  };

  // `firmware` is an ELF or Intel HEX image; errors as ReadFirmwareImage(). The chip has power and
  // has just come out of a power-on reset.
  static Result<std::unique_ptr<Chip>> Load(const std::filesystem::path& firmware, Events events);
  Chip(const Chip&) = delete;
  Chip& operator=(const Chip&) = delete;
  ~Chip();

  [[nodiscard]] SimTime Now() const;
  // Runs up to `time`, or a few cycles past it: an instruction is not split.
  void RunUntil(SimTime time);

  // Puts a byte on the line, behind those that are under way. It is lost where the chip is off or
  // held in reset, where the receiver is off, and where the firmware does not read for 16 byte
  // times (a real one waits for two; libsimavr is too slow to tell).
  void Receive(uint8_t byte);
  [[nodiscard]] size_t BytesUnderWay() const;
  [[nodiscard]] uint64_t BytesLost() const;
  // Returns the bits per second that the firmware has set.
  [[nodiscard]] double BaudRate() const;

  // Returns whether the pin is an output and high.
  [[nodiscard]] bool Drives(ChipPin pin) const;
  // Returns the share of time that output compare unit 'A' or 'B' of timer 0, 1 or 2 holds its pin
  // high; less than 0 if the unit is not connected to its pin.
  [[nodiscard]] double Duty(int timer, char unit) const;
  // Drives an input from outside, from now on and over resets.
  void DriveInput(ChipPin pin, bool high);

  void Reset(ResetCause cause);
  // Takes effect from the next reset on.
  void PutBehind(BootLoader boot_loader);
  // Holds the chip in reset for `duration`, with RAM as it is; then it starts. A low supply voltage
  // does this, and, as far as the outputs see it, so does a boot loader that waits for a
  // programmer.
  void HoldInReset(SimTime duration, ResetCause cause);
  // Cuts the power: time goes on, nothing runs, all outputs are released, bytes are lost.
  void PowerOff();
  // Makes a power-on reset, with RAM as the loss of power leaves it: full of 0xA5.
  void PowerOn();
  [[nodiscard]] bool HasPower() const;

  // Returns the EEPROM, which outlives every reset and the loss of power.
  [[nodiscard]] std::vector<uint8_t> Eeprom() const;
  void WriteEeprom(size_t address, uint8_t byte);

 private:
  struct Impl;
  explicit Chip(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace sateen
