#include "calibration/response/linear_range.h"

#include <algorithm>
#include <cmath>

namespace sateen {

std::optional<LinearRange> FindLinearRange(const std::vector<LinearityBin>& bins, double start_dn,
                                           double tolerance) {
  const auto is_certain = [&](const LinearityBin& bin) {
    return bin.sd <= 0.5 * tolerance;
  };  // (1)
  const auto is_within = [&](const LinearityBin& bin) {
    return is_certain(bin) && std::abs(bin.deviation) <= tolerance;
  };
  const auto is_outside = [&](const LinearityBin& bin) {
    return std::abs(bin.deviation) > tolerance + 2.0 * bin.sd;  // (2)
  };
  const auto start = std::ranges::find_if(
      bins, [&](const LinearityBin& bin) { return bin.level_dn > start_dn && is_within(bin); });
  if (start == bins.end()) {
    return std::nullopt;
  }
  LinearRange range;
  for (auto bin = std::make_reverse_iterator(start + 1); bin != bins.rend() && !is_outside(*bin);
       ++bin) {
    range.from_dn = is_within(*bin) ? bin->level_dn : range.from_dn;
  }
  auto high = start;
  for (auto bin = start; bin != bins.end() && !is_outside(*bin); ++bin) {
    high = is_within(*bin) ? bin : high;
  }
  range.to_dn = high->level_dn;
  // No bin above is within the tolerance, or one that is outside comes first.
  const auto off = std::find_if(high + 1, bins.end(), [&](const LinearityBin& bin) {
    return is_outside(bin) || is_certain(bin);
  });
  if (off != bins.end()) {
    const double limit = std::copysign(tolerance, off->deviation);
    const double share = (limit - high->deviation) / (off->deviation - high->deviation);
    range.to_dn += share * (off->level_dn - high->level_dn);
    range.departs = true;
  }
  return range;
}

}  // namespace sateen
