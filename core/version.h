#pragma once

#include <string>

namespace sateen {

// Returns the version of this build, such as "0.1.0".
[[nodiscard]] std::string Version();

}  // namespace sateen
