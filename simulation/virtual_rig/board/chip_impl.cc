#include "simulation/virtual_rig/board/chip_impl.h"

#include <simavr/avr_extint.h>
#include <simavr/sim_cycle_timers.h>

#include <string_view>

#include "core/check.h"

namespace sateen {
namespace {

// Addresses in data space: data sheet of the ATmega328P, "Register Summary".
constexpr uint16_t kR2 = 0x02;
constexpr uint16_t kMcusr = 0x54;
constexpr uint16_t kIcr1l = 0x86;
struct TimerRegisters {
  uint16_t control_a, control_b, compare_a, compare_b;  // the low byte where there are two
};
constexpr std::array<TimerRegisters, 3> kTimers = {
    {{0x44, 0x45, 0x47, 0x48}, {0x80, 0x81, 0x88, 0x8A}, {0xB0, 0xB1, 0xB3, 0xB4}}};
constexpr unsigned kReceiverBytes = 3;
constexpr int kLongestWaitByteTimes = 16;

uint32_t PortIrqs(size_t index) {
  return AVR_IOCTL_IOPORT_GETIRQ(static_cast<uint32_t>(kChipPorts[index]));
}

// Sleeping costs no wall-clock time: who wants real time paces RunUntil().
void SleepNoTime(avr_t* /*avr*/, avr_cycle_count_t /*cycles*/) {}

}  // namespace

// Called from within avr_reset(), when registers are cleared and modules are not reset yet.
void Chip::Impl::OnReset(avr_t* avr) {
  auto* chip = static_cast<Impl*>(avr->custom.data);
  if (chip->reset_of_model != nullptr) {
    chip->reset_of_model(avr);
  }
  chip->line_busy = false;  // its timer is gone with all others
  const auto flag = static_cast<uint8_t>(chip->cause);
  chip->mcusr = chip->cause == ResetCause::kPowerOn ? flag : chip->mcusr | flag;
  chip->ReleaseOutputs();
  avr_cycle_timer_register(avr, 1, &OnStart, chip);
  if (chip->events.reset) {
    chip->events.reset(chip->cause);
  }
}

// Runs in the first cycle after a reset, when all modules are reset.
avr_cycle_count_t Chip::Impl::OnStart(avr_t* avr, avr_cycle_count_t /*when*/, void* chip) {
  // Otherwise a low level at PD2 or PD3 is polled in every cycle, sleeping or not, which makes it
  // 300 times slower. Firmware that waits for an edge does not miss it.
  avr_extint_set_strict_lvl_trig(avr, 0, 0);
  avr_extint_set_strict_lvl_trig(avr, 1, 0);
  auto* self = static_cast<Impl*>(chip);
  if (self->boot_loader != BootLoader::kNone) {
    avr->data[kR2] = self->boot_loader == BootLoader::kTellsInR2 ? self->mcusr : 0;
    self->mcusr = 0;
  }
  avr->data[kMcusr] = self->mcusr;
  self->ApplyInputs();
  return 0;
}

void Chip::Impl::OnPortWrite(avr_irq_t* /*irq*/, uint32_t value, void* port) {
  auto* self = static_cast<Port*>(port);
  self->output = static_cast<uint8_t>(value);
  self->chip->OutputsChanged();
}

void Chip::Impl::OnDirectionWrite(avr_irq_t* /*irq*/, uint32_t value, void* port) {
  auto* self = static_cast<Port*>(port);
  self->direction = static_cast<uint8_t>(value);
  self->chip->OutputsChanged();
}

void Chip::Impl::OnTimerWrite(avr_irq_t* /*irq*/, uint32_t /*value*/, void* chip) {
  static_cast<Impl*>(chip)->OutputsChanged();
}

// Flags are cleared by writing 0 to them, and set by resets alone.
void Chip::Impl::OnMcusrWrite(avr_irq_t* /*irq*/, uint32_t value, void* chip) {
  auto* self = static_cast<Impl*>(chip);
  self->mcusr &= static_cast<uint8_t>(value);
}

void Chip::Impl::OnSent(avr_irq_t* /*irq*/, uint32_t value, void* chip) {
  const auto* self = static_cast<Impl*>(chip);
  if (self->events.sent) {
    self->events.sent(static_cast<uint8_t>(value));
  }
}

avr_cycle_count_t Chip::Impl::OnByteTime(avr_t* /*avr*/, avr_cycle_count_t /*when*/, void* chip) {
  auto* self = static_cast<Impl*>(chip);
  self->line_busy = false;
  self->PutOnLine();
  return 0;
}

void Chip::Impl::Connect() {
  avr->custom.data = this;
  reset_of_model = avr->reset;
  avr->reset = &OnReset;
  avr->sleep = &SleepNoTime;
  for (avr_io_t* io = avr->io_port; io != nullptr; io = io->next) {
    if (std::string_view(io->kind) == "uart") {
      uart = reinterpret_cast<avr_uart_t*>(io);  // a module begins with its avr_io_t
    } else if (std::string_view(io->kind) == "eeprom") {
      eeprom = reinterpret_cast<avr_eeprom_t*>(io);
    }
  }
  SATEEN_CHECK(uart != nullptr && eeprom != nullptr);
  uart->flags = 0;  // neither print what is sent nor sleep while it polls
  receiver = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), &OnSent,
                          this);
  avr_irq_register_notify(avr_iomem_getirq(avr, kMcusr, nullptr, AVR_IOMEM_IRQ_ALL), &OnMcusrWrite,
                          this);
  for (size_t i = 0; i < kChipPorts.size(); ++i) {
    ports[i].chip = this;
    avr_irq_register_notify(avr_io_getirq(avr, PortIrqs(i), IOPORT_IRQ_REG_PORT), &OnPortWrite,
                            &ports[i]);
    avr_irq_register_notify(avr_io_getirq(avr, PortIrqs(i), IOPORT_IRQ_DIRECTION_ALL),
                            &OnDirectionWrite, &ports[i]);
  }
  for (const TimerRegisters& timer : kTimers) {
    for (const uint16_t address :
         {timer.control_a, timer.control_b, timer.compare_a, timer.compare_b}) {
      avr_irq_register_notify(avr_iomem_getirq(avr, address, nullptr, AVR_IOMEM_IRQ_ALL),
                              &OnTimerWrite, this);
    }
  }
}

void Chip::Impl::ReleaseOutputs() {
  for (size_t i = 0; i < kChipPorts.size(); ++i) {
    ports[i].output = 0;
    ports[i].direction = 0;
    // Otherwise the first write after the reset of what was there before it would be filtered out.
    for (const int irq : {IOPORT_IRQ_REG_PORT, IOPORT_IRQ_DIRECTION_ALL}) {
      avr_io_getirq(avr, PortIrqs(i), irq)->value = 0;
    }
  }
  OutputsChanged();
}

// Tells the pins what drives them from outside; a reset makes libsimavr forget it.
void Chip::Impl::ApplyInputs() {
  for (size_t i = 0; i < kChipPorts.size(); ++i) {
    const avr_ioport_external_t& driven = ports[i].driven;
    avr_ioport_external_t copy = driven;
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(static_cast<uint32_t>(kChipPorts[i])), &copy);
    for (int bit = 0; bit < 8; ++bit) {
      if ((driven.mask >> bit & 1) != 0) {
        avr_raise_irq(avr_io_getirq(avr, PortIrqs(i), IOPORT_IRQ_PIN0 + bit),
                      driven.value >> bit & 1);
      }
    }
  }
}

void Chip::Impl::Reset(ResetCause why) {
  cause = why;
  avr_reset(avr);
  cause = ResetCause::kWatchdog;
}

// Starts the next byte, if there is one and the line is free. libsimavr hands bytes to the firmware
// a little slower than they come and keeps the rest, so the line waits for it, but not for ever.
void Chip::Impl::PutOnLine() {
  if (line_busy || line.empty() || !Runs()) {
    return;
  }
  const auto waiting = static_cast<unsigned>(uart->input.write - uart->input.read) %
                       static_cast<unsigned>(uart_fifo_fifo_size);
  line_busy = true;
  avr_cycle_timer_register(avr, std::max<uint64_t>(uart->cycles_per_byte, 1), &OnByteTime, this);
  const bool listens = avr_regbit_get(avr, uart->rxen) != 0;
  if (listens && waiting >= kReceiverBytes && ++byte_times_waited < kLongestWaitByteTimes) {
    return;
  }
  if (!listens || waiting >= kReceiverBytes) {
    ++bytes_lost;
  } else {
    avr_raise_irq(receiver, line.front());
  }
  line.pop_front();
  byte_times_waited = 0;
}

// Timers 0 and 2 count to 255; timer 1 also to 511, 1023 or the register ICR1.
Chip::Impl::Waveform Chip::Impl::WaveformOf(size_t timer) const {
  const unsigned low = avr->data[kTimers[timer].control_a] & 3U;
  const unsigned control_b = avr->data[kTimers[timer].control_b];
  const unsigned high = control_b >> 3 & 3U;
  Waveform waveform = {.runs = (control_b & 7U) != 0, .fast = low == 3, .top = 255};
  if (timer == 1 && high < 2) {
    waveform.fast = high == 1;
    waveform.top = (256U << (low > 0 ? low - 1 : 0)) - 1;
  } else if (timer == 1) {
    waveform.fast = high == 3;
    waveform.top = std::max<uint32_t>(Word(kIcr1l), 1);
  }
  return waveform;
}

double Chip::Impl::Duty(size_t timer, char unit) const {
  const TimerRegisters& registers = kTimers[timer];
  const uint8_t control = avr->data[registers.control_a];
  const unsigned connection = control >> (unit == 'A' ? 6 : 4) & 3U;
  if (connection < 2) {
    return -1;
  }
  const uint16_t address = unit == 'A' ? registers.compare_a : registers.compare_b;
  const uint32_t compare = timer == 1 ? Word(address) : avr->data[address];
  const Waveform waveform = WaveformOf(timer);
  if (!waveform.runs) {
    return 0;
  }
  const double share = waveform.fast ? (compare + 1.0) / (waveform.top + 1.0)
                                     : static_cast<double>(compare) / waveform.top;
  return connection == 2 ? std::min(share, 1.0) : 1 - std::min(share, 1.0);
}

// Runs to `end`, which is later than Cycle().
void Chip::Impl::RunCpu(uint64_t end) {
  // A sleeping chip jumps from timer to timer; this one makes it stop at the end.
  avr_cycle_timer_register(avr, end - Cycle(), &OnStop, this);
  while (Cycle() < end) {
    const int state = avr_run(avr);
    if (state != cpu_Running && state != cpu_Sleeping) {
      // It jumped into nowhere or sleeps with interrupts off. A real chip would do anything or
      // nothing; this one does nothing until the watchdog bites.
      avr->state = cpu_Stopped;
      avr->cycle += 1;
    }
  }
  avr_cycle_timer_cancel(avr, &OnStop, this);
}

void Chip::Impl::Stop() {
  bytes_lost += line.size();
  line.clear();
  ReleaseOutputs();
}

}  // namespace sateen
