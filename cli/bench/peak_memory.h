#pragma once

namespace sateen::cli {

// Returns the most memory that the process has held since ResetPeakMemory(), or since it began
// where the system cannot reset it.
[[nodiscard]] double PeakMemoryGb();
void ResetPeakMemory();

}  // namespace sateen::cli
