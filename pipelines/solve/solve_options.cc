#include "pipelines/solve/solve_options.h"

namespace sateen {

std::string_view Name(NormalY normal_y) { return normal_y == NormalY::kUp ? "up" : "down"; }

std::string_view Name(Domain domain) {
  return domain == Domain::kAuto ? "auto" : domain == Domain::kRaw ? "raw" : "rgb";
}

std::string_view Name(const std::optional<LadderMode>& robust) {
  return robust ? Name(*robust) : "none";
}

}  // namespace sateen
