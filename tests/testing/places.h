#pragma once

#include <string>

namespace sateen::testing {

// Folders of this checkout and its build. Functions of a library of their own, because a path in a
// test's own compile command would keep a compiler cache from serving another checkout.
[[nodiscard]] std::string SourceDir();
[[nodiscard]] std::string ProgramDir();
[[nodiscard]] std::string FirmwareDir();

}  // namespace sateen::testing
