#pragma once

namespace sateen {

// Returns the bits per second that are set for a terminal, at either end of a pseudo terminal; 0 if
// it is no terminal.
[[nodiscard]] double LineSpeed(int descriptor);

}  // namespace sateen
