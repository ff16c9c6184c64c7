#include "simulation/virtual_rig/board/chip.h"

#include <cstring>
#include <string_view>
#include <utility>

#include "core/check.h"
#include "simulation/virtual_rig/board/chip_impl.h"
#include "simulation/virtual_rig/board/firmware_image.h"

namespace sateen {
namespace {

constexpr size_t kFlashBytes = 32768;
// Addresses in data space: data sheet of the ATmega328P, "Register Summary".
constexpr uint16_t kUcsr0a = 0xC0;
constexpr uint16_t kUbrr0l = 0xC4;
constexpr uint8_t kU2x = 0x02;

size_t PortIndex(char port) {
  const auto* found = std::find(kChipPorts.begin(), kChipPorts.end(), port);
  SATEEN_CHECK(found != kChipPorts.end());
  return static_cast<size_t>(found - kChipPorts.begin());
}

// libsimavr speaks of its own doings; what counts is told by Events.
void Silent(avr_t* /*avr*/, int /*level*/, const char* /*format*/, va_list /*arguments*/) {}

// Returns cycles of 62.5 ns each; rounded up, so that Now() is not before a time that was run to.
uint64_t CyclesOf(SimTime time) { return (static_cast<uint64_t>(time.count()) * 2 + 124) / 125; }

}  // namespace

std::string_view Name(ResetCause cause) {
  switch (cause) {
    case ResetCause::kPowerOn:
      return "power-on";
    case ResetCause::kExternal:
      return "external";
    case ResetCause::kBrownOut:
      return "brown-out";
    case ResetCause::kWatchdog:
      return "watchdog";
  }
  return "unknown";
}

Chip::Chip(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Chip::~Chip() = default;

Result<std::unique_ptr<Chip>> Chip::Load(const std::filesystem::path& firmware, Events events) {
  avr_global_logger_set(&Silent);
  const Result<std::vector<uint8_t>> image = ReadFirmwareImage(firmware, kFlashBytes);
  if (!image) {
    return tl::unexpected(image.error());
  }
  auto impl = std::make_unique<Impl>();
  impl->avr = avr_make_mcu_by_name("atmega328p");
  SATEEN_CHECK(impl->avr != nullptr);
  impl->events = std::move(events);
  avr_init(impl->avr);
  impl->avr->frequency = static_cast<uint32_t>(kClockHz);
  std::memcpy(impl->avr->flash, image->data(), image->size());
  impl->avr->codeend = static_cast<uint32_t>(image->size());
  impl->Connect();
  impl->SpoilRam();
  impl->Reset(ResetCause::kPowerOn);
  return std::unique_ptr<Chip>(new Chip(std::move(impl)));
}

SimTime Chip::Now() const { return SimTime(static_cast<SimTime::rep>(impl_->Cycle() * 125 / 2)); }

void Chip::RunUntil(SimTime time) {
  const uint64_t end = CyclesOf(time);
  while (impl_->Cycle() < end) {
    if (impl_->Runs()) {
      impl_->RunCpu(end);
    } else if (impl_->held_until && impl_->held_until->cycle <= end) {
      const Impl::Start start = *impl_->held_until;
      impl_->cycles_off += start.cycle - std::min(start.cycle, impl_->Cycle());
      impl_->held_until.reset();
      impl_->Reset(start.cause);
    } else {
      impl_->cycles_off += end - impl_->Cycle();
    }
  }
}

void Chip::Receive(uint8_t byte) {
  if (!impl_->Runs()) {
    ++impl_->bytes_lost;
    return;
  }
  impl_->line.push_back(byte);
  impl_->PutOnLine();
}

size_t Chip::BytesUnderWay() const { return impl_->line.size() + (impl_->line_busy ? 1 : 0); }

uint64_t Chip::BytesLost() const { return impl_->bytes_lost; }

double Chip::BaudRate() const {
  const bool fast = (impl_->avr->data[kUcsr0a] & kU2x) != 0;
  const uint32_t divider = impl_->Word(kUbrr0l) + 1;
  return kClockHz / (fast ? 8.0 : 16.0) / divider;
}

bool Chip::Drives(ChipPin pin) const {
  const Impl::Port& port = impl_->ports[PortIndex(pin.port)];
  return (port.output & port.direction & 1U << pin.bit) != 0;
}

double Chip::Duty(int timer, char unit) const {
  return impl_->Duty(static_cast<size_t>(timer), unit);
}

void Chip::DriveInput(ChipPin pin, bool high) {
  avr_ioport_external_t& driven = impl_->ports[PortIndex(pin.port)].driven;
  const auto bit = static_cast<unsigned>(1U << pin.bit);
  driven.mask = (driven.mask | bit) & 0xFFU;
  driven.value = (high ? driven.value | bit : driven.value & ~bit) & 0xFFU;
  if (impl_->Runs()) {
    impl_->ApplyInputs();
  }
}

void Chip::Reset(ResetCause cause) {
  if (impl_->has_power) {
    impl_->held_until.reset();
    impl_->Reset(cause);
  }
}

void Chip::PutBehind(BootLoader boot_loader) { impl_->boot_loader = boot_loader; }

void Chip::HoldInReset(SimTime duration, ResetCause cause) {
  if (impl_->has_power) {
    impl_->held_until = {.cycle = impl_->Cycle() + CyclesOf(duration), .cause = cause};
    impl_->Stop();
  }
}

void Chip::PowerOff() {
  impl_->has_power = false;
  impl_->held_until.reset();
  impl_->Stop();
}

void Chip::PowerOn() {
  if (!impl_->has_power) {
    impl_->has_power = true;
    impl_->SpoilRam();
    impl_->Reset(ResetCause::kPowerOn);
  }
}

bool Chip::HasPower() const { return impl_->has_power; }

std::vector<uint8_t> Chip::Eeprom() const {
  return {impl_->eeprom->eeprom, impl_->eeprom->eeprom + impl_->eeprom->size};
}

void Chip::WriteEeprom(size_t address, uint8_t byte) {
  SATEEN_CHECK(address < impl_->eeprom->size);
  impl_->eeprom->eeprom[address] = byte;
}

}  // namespace sateen
