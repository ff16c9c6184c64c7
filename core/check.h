#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>

// Ends the run when our own code breaks a promise. What a user, a file or a device can cause is
// an Error instead (core/error.h).
#define SATEEN_CHECK(condition)                                                                   \
  do {                                                                                            \
    if (!(condition)) {                                                                           \
      fmt::print(stderr, "sateen: internal error: {}:{}: {} does not hold\n", __FILE__, __LINE__, \
                 #condition);                                                                     \
      std::abort();                                                                               \
    }                                                                                             \
  } while (false)
