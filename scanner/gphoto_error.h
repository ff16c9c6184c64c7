#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/error.h"

namespace sateen {

// An error of libgphoto2 as the worker reports it, {"code", "text", "while"}, in words with what to do.
[[nodiscard]] Error FromLibrary(const nlohmann::json& error, const std::string& port);

// Also where it may be gone: a connection that broke is kUnspecified as often as not.
[[nodiscard]] bool ConnectionIsGone(const nlohmann::json& error);

}  // namespace sateen
