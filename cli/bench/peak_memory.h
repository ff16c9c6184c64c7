#pragma once

namespace sateen::cli {

// Most memory that the process has held since ResetPeakMemory(), or, where the system cannot do
// that, since it began.
[[nodiscard]] double PeakMemoryGb();
void ResetPeakMemory();

}  // namespace sateen::cli
