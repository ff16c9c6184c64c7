#pragma once

#include <Eigen/Core>
#include <string_view>

#include "core/error.h"
#include "core/option_range.h"

namespace sateen {

// Fails as CheckRange does unless each component is within 0 to 1.
inline Status CheckColour(std::string_view field, const Eigen::Vector3d& colour) {
  for (const double value : colour) {
    if (Status status = CheckRange(field, value, 0.0, 1.0); !status) {
      return status;
    }
  }
  return {};
}

}  // namespace sateen
