#include "pipelines/simulate/simulate.h"

#include <algorithm>
#include <utility>

#include "core/files/output_folder.h"

namespace sateen {

namespace fs = std::filesystem;

Result<SceneFile> SimulateSession(const SimulateOptions& options, const Task& task) {
  Result<SceneFile> file = ReadSceneFile(options.scene);
  if (!file) {
    return file;
  }
  for (const fs::path& input : file->inputs) {
    std::error_code ignored;  // a folder that does not exist yet holds no input
    if (fs::equivalent(fs::absolute(input).parent_path(), options.output, ignored)) {
      return Fail(ErrorCode::kInvalidArgument,
                  "{}: holds {}, which the scene is made of and the session could replace; give "
                  "another folder for the session",
                  options.output.string(), input.filename().string());
    }
  }
  Result<OutputFolder> folder = OutputFolder::Open(options.output);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  const Status done = StageSimulatedSession(*file, options.format, task, *folder).and_then([&] {
    return folder->Commit();
  });
  if (!done) {
    return tl::unexpected(folder->InPlace(done.error()));
  }
  return file;
}

Result<std::vector<ListedScene>> ListScenes(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".json") {
      paths.push_back(entry.path());
    }
  }
  if (error) {
    return Fail(ErrorCode::kIo, "{}: {}; need a folder of scene files", folder.string(),
                error.message());
  }
  std::ranges::sort(paths);
  std::vector<ListedScene> scenes;
  for (fs::path& path : paths) {
    Result<SceneFile> file = ReadSceneFile(path);
    scenes.push_back({.path = std::move(path), .file = std::move(file)});
  }
  return scenes;
}

}  // namespace sateen
