#include "cli/simulate.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>
#include <utility>

#include "pipelines/simulate/scene_file.h"
#include "pipelines/simulate/simulated_session.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSampleScenes = "samples/scenes";

// The scenes of a folder with their titles; a file that cannot be read says why.
int ListScenes(const fs::path& folder, std::ostream& out, std::ostream& log) {
  std::error_code error;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".json") {
      files.push_back(entry.path());
    }
  }
  if (error) {
    log << fmt::format("sateen simulate: error: {}: {}; need a folder of scene files\n",
                       folder.string(), error.message());
    return ExitStatus(Error{ErrorCode::kIo, ""});
  }
  std::ranges::sort(files);
  for (const fs::path& path : files) {
    const Result<SceneFile> file = ReadSceneFile(path);
    if (!file) {
      out << fmt::format("{}\n    cannot be read: {}\n", path.string(), file.error().message);
      continue;
    }
    const ImageSize size = file->scene.rig.camera->size_px;
    out << fmt::format("{}\n    {} ({}, {} lights, {}x{} px)\n", path.string(), file->title,
                       Name(file->kind), file->scene.rig.lights.size(), size.width, size.height);
  }
  return 0;
}

Result<SceneFile> Simulate(const SimulateArgs& args, const Task& task) {
  Result<SceneFile> file = ReadSceneFile(args.scene);
  if (!file) {
    return file;
  }
  for (const fs::path& input : file->inputs) {
    std::error_code ignored;  // a folder that does not exist yet holds no input
    if (fs::equivalent(fs::absolute(input).parent_path(), args.output, ignored)) {
      return Fail(ErrorCode::kInvalidArgument,
                  "{}: holds {}, which the scene is made of and the session could replace; give a "
                  "folder of its own for the session",
                  args.output.string(), input.filename().string());
    }
  }
  Result<OutputFolder> folder = OutputFolder::Open(args.output);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  const FrameFormat format = args.linear ? FrameFormat::kLinearExr : FrameFormat::kRawDng;
  Status status = StageSimulatedSession(*file, format, task, *folder);
  if (status) {
    status = folder->Commit();
  }
  if (!status) {
    return tl::unexpected(folder->InPlace(status.error()));
  }
  return file;
}

}  // namespace

void AddSimulate(CLI::App& root, SimulateArgs& args) {
  CLI::App* cmd = root.add_subcommand(
      "simulate", "Render a scene with known answers as the session a scanner would have captured");
  cmd->add_option("scene", args.scene,
                  "Scene file, as in samples/scenes; with --list a folder of them");
  cmd->add_option("-o,--output", args.output, "Folder for the session; made where missing");
  cmd->add_flag("--linear", args.linear,
                "Frames as linear float EXR, without the sensor, instead of Bayer DNG");
  cmd->add_flag("--list", args.list, "List the scenes of a folder (samples/scenes) and end");
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->final_callback([&args] {
    if (!args.list && args.scene.empty()) {
      throw CLI::RequiredError("scene");
    }
    if (!args.list && args.output.empty()) {
      throw CLI::RequiredError("--output");
    }
  });
}

int RunSimulate(const SimulateArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  if (args.list) {
    return ListScenes(args.scene.empty() ? fs::path(kSampleScenes) : args.scene, out, log);
  }
  const Result<SceneFile> file = Simulate(args, task.WithThreads(args.threads));
  task.ClearProgress();
  if (!file) {
    log << "sateen simulate: error: " << file.error().message << '\n';
    return ExitStatus(file.error());
  }
  const ImageSize size = file->scene.rig.camera->size_px;
  out << fmt::format("rendered {} lights and the dark at {}x{} px, with truth, to {}\n",
                     file->scene.rig.lights.size(), size.width, size.height, args.output.string());
  return 0;
}

}  // namespace sateen::cli
