#pragma once

#include <fmt/core.h>

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace sateen {

// Kinds of error, by what the caller can do; ExitStatus() maps each to one exit status of the
// program.
enum class ErrorCode {
  kInvalidArgument,  // the caller's options are wrong: change the command
  kBadData,          // a file or a stack contradicts itself or its format: change the data
  kDegenerate,       // the data are well formed but cannot determine the answer
  kIo,               // a file cannot be read or written
  kDevice,           // a device refuses or is absent
  kTimeout,          // a device does not answer in time
  kCancelled,        // a person or a signal asked to stop
  kOutOfMemory       // the data are fine, and this machine has no room for them
};

// `message` says what was found, what was needed and what to do.
struct Error {
  ErrorCode code;
  std::string message;
};

template <typename T>
using Result = tl::expected<T, Error>;
using Status = Result<void>;

template <typename... Args>
tl::unexpected<Error> Fail(ErrorCode code, fmt::format_string<Args...> text, Args&&... args) {
  return tl::unexpected<Error>({code, fmt::format(text, std::forward<Args>(args)...)});
}

// Returns 1 out of memory, 2 usage, 3 bad or degenerate data, 4 I/O, 5 device, 6 cancelled. (0 is
// done, 1 internal too.)
[[nodiscard]] int ExitStatus(const Error& error);

}  // namespace sateen
