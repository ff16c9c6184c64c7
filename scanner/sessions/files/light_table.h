#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rig/light.h"
#include "scanner/sessions/files/text_table.h"

namespace sateen {

// Lengths that a file may give a direction before it is normalised.
struct LengthRange {
  double least;
  double most;
};
inline constexpr LengthRange kUnitLengths = {0.99, 1.01};  // files round to as few as two digits

// kBadData names the first row with another number of values.
[[nodiscard]] Status CheckWidths(const std::vector<NumberRow>& rows, size_t width,
                                 std::string_view needed);

// Returns distant lights "light-0", "light-1", ... from rows of a direction (3 values) or a
// direction and an RGB intensity (6 values). kBadData where a length or an intensity is out of
// range.
[[nodiscard]] Result<Lights> LightsFromRows(const std::vector<NumberRow>& rows,
                                            LengthRange lengths);

// Reads lights.txt: optionally the count, then one line "x y z" or "x y z red green blue" for each
// light. Three lines of K numbers, K neither 3 nor 6, are one column for each light.
[[nodiscard]] Result<Lights> ReadLightTable(const std::filesystem::path& path,
                                            std::map<std::string, std::string>& sha256_of_input);

}  // namespace sateen
