#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/error.h"

namespace sateen {

// Returns 64 lower-case hexadecimal digits.
[[nodiscard]] std::string Sha256(std::string_view bytes);
[[nodiscard]] Result<std::string> Sha256OfFile(const std::filesystem::path& path);

}  // namespace sateen
