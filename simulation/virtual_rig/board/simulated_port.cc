#include "simulation/virtual_rig/board/simulated_port.h"

#include <algorithm>
#include <utility>

#include "core/check.h"

namespace sateen {
namespace {

using std::chrono::seconds;

// Returns the same for every standard library, unlike std::uniform_real_distribution.
double Uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1.0p-53; }

}  // namespace

Status LineFaults::Validate() const {
  for (const auto& [name, value] : {std::pair("drop", drop), {"flip", flip}, {"insert", insert}}) {
    if (!(value >= 0 && value <= 1)) {
      return Fail(ErrorCode::kInvalidArgument, "line fault '{}' is {}; need a probability, 0 to 1",
                  name, value);
    }
  }
  return {};
}

SimulatedPort::SimulatedPort(VirtualBoard& board, const LineFaults& faults, bool opening_resets)
    : board_(board), faults_(faults), opening_resets_(opening_resets), random_(faults.seed) {
  SATEEN_CHECK(faults.Validate().has_value());
}

Status SimulatedPort::Open() {
  if (!board_.Plugged()) {
    return Fail(ErrorCode::kDevice, "{}: is not plugged in; plug it in", Name());
  }
  if (opening_resets_) {
    board_.ResetByHost(seconds(1));
  }
  open_ = true;
  plugged_at_open_ = board_.TimesPlugged();
  board_.TakeSent();
  waiting_.clear();
  return {};
}

Status SimulatedPort::CheckOpen() const {
  if (!open_ || !board_.Plugged() || board_.TimesPlugged() != plugged_at_open_) {
    return Fail(ErrorCode::kDevice, "{}: the port is gone; is the board plugged in?", Name());
  }
  return {};
}

Status SimulatedPort::Write(std::span<const uint8_t> bytes) {
  if (Status open = CheckOpen(); !open) {
    return open;
  }
  board_.Send(OverTheLine(bytes));
  return {};
}

Result<size_t> SimulatedPort::Read(std::span<uint8_t> buffer, Duration longest) {
  const auto arrived = [&] {
    const std::vector<uint8_t> bytes = OverTheLine(board_.TakeSent());
    waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
    return !waiting_.empty() || !CheckOpen();
  };
  board_.RunUntil(arrived, longest);
  if (const Status open = CheckOpen(); !open) {
    return tl::unexpected(open.error());
  }
  const size_t count = std::min(buffer.size(), waiting_.size());
  const auto end = waiting_.begin() + static_cast<std::ptrdiff_t>(count);
  std::copy(waiting_.begin(), end, buffer.begin());
  waiting_.erase(waiting_.begin(), end);
  return count;
}

std::vector<uint8_t> SimulatedPort::OverTheLine(std::span<const uint8_t> bytes) {
  counts_.bytes += bytes.size();
  if (faults_.drop + faults_.flip + faults_.insert == 0) {
    return {bytes.begin(), bytes.end()};
  }
  std::vector<uint8_t> out;
  for (const uint8_t byte : bytes) {
    if (Uniform(random_) < faults_.insert) {
      ++counts_.inserted;
      out.push_back(static_cast<uint8_t>(random_()));
    }
    if (Uniform(random_) < faults_.drop) {
      ++counts_.dropped;
      continue;
    }
    const bool flip = Uniform(random_) < faults_.flip;
    counts_.flipped += flip ? 1 : 0;
    out.push_back(flip ? static_cast<uint8_t>(byte ^ 1U << (random_() & 7)) : byte);
  }
  return out;
}

}  // namespace sateen
