#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "core/error.h"

namespace sateen {

// A serial port as the LED board's link sees it: bytes, and the clock by which they are waited for.
// SerialPort is the real one; tests put their own in its place, with faults and with simulated
// time.
class BytePort {
 public:
  using Duration = std::chrono::microseconds;

  BytePort() = default;
  BytePort(const BytePort&) = delete;
  BytePort& operator=(const BytePort&) = delete;
  virtual ~BytePort() = default;

  // Returns the name that people use: "/dev/ttyACM0".
  [[nodiscard]] virtual std::string Name() const = 0;

  // Opens it, with nothing waiting to be read; also after Close() and after it was lost.
  // kDevice: it is not there, or another program has it.
  [[nodiscard]] virtual Status Open() = 0;
  virtual void Close() noexcept = 0;

  // Sends all bytes. kDevice: the port is gone.
  [[nodiscard]] virtual Status Write(std::span<const std::uint8_t> bytes) = 0;
  // Waits until something has arrived and returns how many bytes of it are now in `buffer`; 0 when
  // `longest` has passed. kDevice: the port is gone.
  [[nodiscard]] virtual Result<std::size_t> Read(std::span<std::uint8_t> buffer,
                                                 Duration longest) = 0;

  // The port's clock, from any origin, and waiting by it.
  [[nodiscard]] virtual Duration Now() const = 0;
  virtual void Wait(Duration time) = 0;
};

}  // namespace sateen
