#include "core/check.h"

#include <fmt/core.h>

#include <cstdio>
#include <cstdlib>

namespace sateen {

void FailCheck(const char* file, int line, const char* condition) {
  fmt::print(stderr, "sateen: internal error: {}:{}: {} does not hold\n", file, line, condition);
  std::abort();
}

}  // namespace sateen
