#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "rig/rig.h"
#include "simulation/sensor.h"

namespace sateen {

/// The scene under the virtual camera, as the camera sees it under each light alone. Light is
/// additive, so every frame is a sum of these pictures. One value per site of the sensor:
///
///     v(x, y) = s_c i_c(x, y) / full_scale,    c the colour of the site, i radiance          (1)
///
/// so that 1 is what reads as white at the exposure that `full_scale` is of.
struct LitScene {
  std::string folder;
  Rig rig;
  std::vector<Image<float>> lights;  // in the order of the rig's, without ambient light
  Image<float> ambient;              // picture with all lights off
};

/// Reads a session of linear frames, as `sateen simulate SCENE --linear -o DIR` writes it: one
/// frame of each light, and dark frames, whose mean is the ambient light and is in every lit frame.
///
/// Memory   4 bytes per site for each light and once more; 12 per site besides while a frame is
///          read, on each thread
/// Errors   kIo: a file is absent or unreadable
///          kBadData: a file that is not what the session recorded; RAW or other frames that are
///          not linear radiance; a light without a frame, no dark frame; a camera of unknown size
///          kInvalidArgument: the sensor; kCancelled
[[nodiscard]] Result<LitScene> ReadLitScene(const std::filesystem::path& dir, const Sensor& sensor,
                                            const Task& task = {});

// Reads the rig of such a session alone.
[[nodiscard]] Result<Rig> ReadSceneRig(const std::filesystem::path& dir);

// Fails with kBadData unless both have the same lights on the same channels and a camera of the
// same size. `what` and `other` are their files.
[[nodiscard]] Status RequireSameRig(const Rig& rig, const std::string& what, const Rig& other_rig,
                                    const std::string& other);

// As `rig` says where it has a response: levels, and noise where the response has it.
[[nodiscard]] Sensor SensorOfRig(const Rig& rig, const Sensor& otherwise);

}  // namespace sateen
