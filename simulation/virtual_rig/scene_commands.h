#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "core/error.h"
#include "simulation/virtual_rig/camera/scene_camera.h"
#include "simulation/virtual_rig/camera/virtual_camera.h"
#include "simulation/virtual_rig/rig_action.h"

namespace sateen {

// Commands that ParseSceneCommand() understands, for people.
inline constexpr std::string_view kSceneCommands =
    "scene DIR, camera FAULT [N], ambient FACTOR, nudge DX DY, swap A B, double A B, "
    "light K FACTOR, shade X Y RADIUS FACTOR [N]";

// A line that is about the camera and what it sees:
//
//     scene DIR                 another object under the camera
//     camera FAULT [N]          the next N captures go wrong so (1); "camera wake"
//     ambient FACTOR            times the scene's ambient light
//     nudge DX DY               the picture moves by so many pixels to the right and down
//     swap A B, double A B      wiring of two lights; A also lights B
//     light K FACTOR            of its light; 0: dead
//     shade X Y RADIUS FACTOR [N]   a disc of the picture keeps FACTOR of its light in the next N
//                               frames (1); pixels
//
// `scene_read` is told by another thread how reading a scene has gone. Nothing where the verb is
// none of these. kInvalidArgument for what does not fit it. `scene` and `camera` must outlive the
// action.
[[nodiscard]] std::optional<Result<RigAction>> ParseSceneCommand(
    const std::string& line, SceneCamera& scene, VirtualCamera& camera,
    std::function<void(const std::string& dir, const Status&)> scene_read);

}  // namespace sateen
