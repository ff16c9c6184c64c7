#pragma once

#include <cstddef>
#include <vector>

#include "core/statistics.h"

namespace sateen {

/// Returns the standard deviation of residuals about zero, from the median of their sizes,
/// 1.4826 med |r|; at least 1e-12. `residuals` is not empty.
[[nodiscard]] double SpreadOf(const std::vector<double>& residuals);

/// Returns those of the indices whose three residuals are within 4 times `spread`. Residuals
/// 3 i, 3 i + 1 and 3 i + 2 belong to indices[i].
[[nodiscard]] std::vector<size_t> OnModel(const std::vector<size_t>& indices,
                                          const std::vector<double>& residuals, double spread);

/// Returns the root mean square; 0 of no values.
[[nodiscard]] double Rms(const std::vector<double>& values);

}  // namespace sateen
