#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "pipelines/simulate/scene_file.h"
#include "pipelines/simulate/simulated_session.h"

namespace sateen {

struct SimulateOptions {
  std::filesystem::path scene;   // scene file (docs/simulation.md)
  std::filesystem::path output;  // folder for the session; created if missing
  FrameFormat format = FrameFormat::kRawDng;
};

/// Renders a scene file into a session folder. Returns the scene. On failure the folder stays as it
/// was.
///
/// Errors   kInvalidArgument: the output folder holds a file that the scene is made of
///          those of ReadSceneFile() and StageSimulatedSession()
[[nodiscard]] Result<SceneFile> SimulateSession(const SimulateOptions& options,
                                                const Task& task = {});

// A scene file of a folder, or why it cannot be read.
struct ListedScene {
  std::filesystem::path path;
  Result<SceneFile> file;
};

// Reads the scene files of a folder, by name.
//
// Errors  kIo: the folder cannot be read
[[nodiscard]] Result<std::vector<ListedScene>> ListScenes(const std::filesystem::path& folder);

}  // namespace sateen
