#pragma once

#include <optional>
#include <string_view>

#include "imaging/image_io.h"

namespace sateen {

// Returns "auto", "linear" or "srgb".
[[nodiscard]] std::string_view Name(Encoding encoding);
[[nodiscard]] std::optional<Encoding> EncodingNamed(std::string_view name);

}  // namespace sateen
