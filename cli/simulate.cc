#include "cli/simulate.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ostream>

namespace sateen::cli {
namespace {

constexpr const char* kSampleScenes = "samples/scenes";

int SimulateFailed(const Error& error, std::ostream& log) {
  log << "sateen simulate: error: " << error.message << '\n';
  return ExitStatus(error);
}

// Prints the scenes of a folder with their titles; of a file that cannot be read why.
int PrintScenes(const std::filesystem::path& folder, std::ostream& out, std::ostream& log) {
  const Result<std::vector<ListedScene>> scenes = ListScenes(folder);
  if (!scenes) {
    return SimulateFailed(scenes.error(), log);
  }
  for (const auto& [path, file] : *scenes) {
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

}  // namespace

void AddSimulate(CLI::App& root, SimulateArgs& args) {
  CLI::App* cmd = root.add_subcommand(
      "simulate", "Render a scene with known answers as the session a scanner would have captured");
  cmd->add_option("scene", args.options.scene,
                  "Scene file, as in samples/scenes; with --list a folder of them");
  cmd->add_option("-o,--output", args.options.output, "Folder for the session; created if missing");
  cmd->add_flag("--linear", args.linear,
                "Frames as linear float EXR, without the sensor, instead of Bayer DNG");
  cmd->add_flag("--list", args.list, "List the scenes of a folder (samples/scenes), then exit");
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->final_callback([&args] {
    if (!args.list && args.options.scene.empty()) {
      throw CLI::RequiredError("scene");
    }
    if (!args.list && args.options.output.empty()) {
      throw CLI::RequiredError("--output");
    }
  });
}

int RunSimulate(const SimulateArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  if (args.list) {
    return PrintScenes(args.options.scene.empty() ? kSampleScenes : args.options.scene, out, log);
  }
  SimulateOptions options = args.options;
  options.format = args.linear ? FrameFormat::kLinearExr : FrameFormat::kRawDng;
  const Result<SceneFile> file = SimulateSession(options, task.WithThreads(args.threads));
  task.ClearProgress();
  if (!file) {
    return SimulateFailed(file.error(), log);
  }
  const ImageSize size = file->scene.rig.camera->size_px;
  out << fmt::format("rendered {} lights and the dark frame at {}x{} px, with truth, to {}\n",
                     file->scene.rig.lights.size(), size.width, size.height,
                     options.output.string());
  return 0;
}

}  // namespace sateen::cli
