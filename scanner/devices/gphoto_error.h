#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/error.h"

namespace sateen {

// Returns an error that the worker reports, in words with what to do: of libgphoto2, {"code",
// "text", "while"}, a kDevice; of this computer's disk, {"errno", "path"}, a kIo.
[[nodiscard]] Error FromLibrary(const nlohmann::json& error, const std::string& port);

// Returns whether the connection is, or may be, gone: a connection that broke is kUnspecified as
// often as not.
[[nodiscard]] bool ConnectionIsGone(const nlohmann::json& error);

// Returns whether the memory card is full, which only a person can fix.
[[nodiscard]] bool CardIsFull(const nlohmann::json& error);

}  // namespace sateen
