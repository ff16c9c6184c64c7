#pragma once

// Ends the run when our own code breaks a promise. What a user, a file or a device can cause is
// an Error instead (core/error.h).
#define SATEEN_CHECK(condition)                            \
  do {                                                     \
    if (!(condition)) {                                    \
      ::sateen::FailCheck(__FILE__, __LINE__, #condition); \
    }                                                      \
  } while (false)

namespace sateen {

// Prints "sateen: internal error: FILE:LINE: CONDITION does not hold" and aborts.
[[noreturn]] void FailCheck(const char* file, int line, const char* condition);

}  // namespace sateen
