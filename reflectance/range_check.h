#pragma once

#include <Eigen/Core>
#include <string_view>

#include "core/error.h"

namespace sateen {

// kInvalidArgument names the field, its value and its range; NaN is out of every range.
inline Status CheckRange(std::string_view field, double value, double least, double most) {
  if (!(value >= least && value <= most)) {
    return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {:g} to {:g}", field, value, least,
                most);
  }
  return {};
}

inline Status CheckColour(std::string_view field, const Eigen::Vector3d& colour) {
  for (const double value : colour) {
    if (Status status = CheckRange(field, value, 0.0, 1.0); !status) {
      return status;
    }
  }
  return {};
}

}  // namespace sateen
