#include "rig/plausible.h"

namespace sateen {

Status CheckPlausible(std::string_view what, std::string_view name,
                      std::initializer_list<double> values, const Plausible& range) {
  for (const double value : values) {
    if (!(value >= range.least && value <= range.most)) {
      return Fail(ErrorCode::kBadData, "{}{} is {:.6g}; need {:g} to {:g}{}", what, name, value,
                  range.least, range.most, range.unit);
    }
  }
  return {};
}

}  // namespace sateen
