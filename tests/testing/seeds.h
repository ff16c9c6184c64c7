#pragma once

#include <cstdlib>
#include <string_view>

namespace sateen::testing {

// Returns how many random draws a statistical test takes: `all`, or `few` where the environment
// says SATEEN_SEEDS=few, as "make asan" does. The test's bounds hold for both.
[[nodiscard]] inline int SeedsOf(int all, int few) {
  const char* const seeds = std::getenv("SATEEN_SEEDS");
  return seeds != nullptr && std::string_view(seeds) == "few" ? few : all;
}

}  // namespace sateen::testing
