#pragma once

#include <chrono>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "core/error.h"

namespace sateen {

// Messages between this program and the process that talks to the camera, over a socket: a length
// of four bytes, little-endian, then JSON of at most 1 MiB.

// Sends a message. kDevice: the other side is gone.
[[nodiscard]] Status SendMessage(int socket, const nlohmann::json& message);
// Receives a message. Fields that a message may have are of their types (gphoto_session.h has the
// table), so that no reader needs to look.
// kTimeout: nothing, or not all of it, within `longest`, which is for ever where absent; kDevice:
// the other side is gone, or sent too much; kBadData: it is no JSON object, or a field is of another
// type, and the next message can be received.
[[nodiscard]] Result<nlohmann::json> ReceiveMessage(
    int socket, std::optional<std::chrono::milliseconds> longest);

}  // namespace sateen
