#include "core/option_range.h"

#include <fmt/format.h>

namespace sateen {

tl::unexpected<Error> OutOfRange(std::string_view name, double value, std::string_view range) {
  return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", name, value, range);
}

Status CheckRange(std::string_view name, double value, double min, double max) {
  if (!(value >= min && value <= max)) {
    return OutOfRange(name, value, fmt::format("{:g} to {:g}", min, max));
  }
  return {};
}

}  // namespace sateen
