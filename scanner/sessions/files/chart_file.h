#pragma once

#include <filesystem>

#include "calibration/response/chart.h"
#include "core/error.h"

namespace sateen {

/// Reads a file of a neutral chart's patches, schema sateen.chart/1 (docs/formats.md).
///
/// Errors   kIo: absent or unreadable
///          kBadData: a key that is missing, unknown or out of range
[[nodiscard]] Result<Chart> ReadChartFile(const std::filesystem::path& path);

}  // namespace sateen
