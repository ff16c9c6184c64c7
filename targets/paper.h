#pragma once

#include <Eigen/Core>
#include <string_view>

#include "core/error.h"

namespace sateen {

/// Returns width and height of a paper as it is named, upright: "A4", "A3", "A2", "letter", or
/// "200x150mm".
///
/// Errors   kInvalidArgument: another name; a side that is not 20 to 2000 mm
[[nodiscard]] Result<Eigen::Vector2d> PaperSizeMm(std::string_view name);

}  // namespace sateen
