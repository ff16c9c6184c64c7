#pragma once

namespace sateen {

// Bits a second that are set for a terminal, at either end of a pseudo terminal; 0 where it is none.
[[nodiscard]] double LineSpeed(int descriptor);

}  // namespace sateen
