#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "scanner/devices/byte_port.h"
#include "simulation/virtual_rig/board/virtual_board.h"

namespace sateen {

// Faults of a bad cable, per byte and in both directions: the probabilities that it is lost, that
// one bit of it is flipped, and that a random byte comes before it.
struct LineFaults {
  double drop = 0;
  double flip = 0;
  double insert = 0;
  uint64_t seed = 1;

  [[nodiscard]] Status Validate() const;
};

// The virtual board's serial port inside one program, for LightBoard. Waiting passes simulated
// time, so that a test is deterministic and does not wait. Unplugging the board loses the port
// until it is opened again, however soon the board is plugged in.
class SimulatedPort : public BytePort {
 public:
  // `board` must outlive the port. `opening_resets`: as on an Uno, opening the port resets the
  // board, whose boot loader then takes a second.
  explicit SimulatedPort(VirtualBoard& board, const LineFaults& faults = {},
                         bool opening_resets = false);

  [[nodiscard]] std::string Name() const override { return "simulated board"; }
  [[nodiscard]] Status Open() override;
  void Close() noexcept override { open_ = false; }
  [[nodiscard]] Status Write(std::span<const uint8_t> bytes) override;
  [[nodiscard]] Result<size_t> Read(std::span<uint8_t> buffer, Duration longest) override;
  [[nodiscard]] Duration Now() const override {
    return std::chrono::duration_cast<Duration>(board_.Now());
  }
  void Wait(Duration time) override { board_.RunFor(time); }

  // Until now. `bytes` counts those that were given to the line.
  struct Counts {
    uint64_t bytes = 0;
    uint64_t dropped = 0;
    uint64_t flipped = 0;
    uint64_t inserted = 0;
  };
  [[nodiscard]] const Counts& Faults() const { return counts_; }

 private:
  [[nodiscard]] Status CheckOpen() const;
  // Returns `bytes` as they come out of the other end of the line.
  std::vector<uint8_t> OverTheLine(std::span<const uint8_t> bytes);

  VirtualBoard& board_;
  LineFaults faults_;
  bool opening_resets_;
  bool open_ = false;
  uint64_t plugged_at_open_ = 0;
  std::vector<uint8_t> waiting_;
  std::mt19937_64 random_;
  Counts counts_;
};

}  // namespace sateen
