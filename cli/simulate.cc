#include "cli/simulate.h"

#include <ostream>
#include <utility>

#include "core/angle.h"
#include "core/json.h"
#include "core/output_folder.h"
#include "core/sha256.h"
#include "imaging/image_io.h"
#include "rig/rig.h"
#include "scanner/session.h"
#include "simulation/relief.h"

namespace sateen::cli {
namespace {

struct SceneFile {
  ReliefScene scene;
  Rig rig;
};

// Schema sateen.scene/1, docs/formats.md.
Result<SceneFile> ReadScene(const std::filesystem::path& path) {
  const Result<nlohmann::json> json = ReadJsonFile(path, "sateen.scene", 1);
  if (!json) {
    return tl::unexpected(json.error());
  }
  SceneFile file;
  JsonReader top(*json, path.string());
  const std::string rig_file = top.String("rig");
  JsonReader surface = top.Object("surface");
  const std::string shape_name = surface.String("shape");
  const std::optional<ReliefShape> shape = ReliefShapeNamed(shape_name);
  surface.Require(shape.has_value(), "shape",
                  fmt::format("'{}'; need flat, dome or ripple", shape_name));
  file.scene.shape = shape.value_or(ReliefShape::kFlat);
  if (file.scene.shape != ReliefShape::kFlat) {
    const double slope_deg = surface.Number("max_slope_deg");
    surface.Require(slope_deg >= 0.0 && slope_deg < 90.0, "max_slope_deg",
                    fmt::format("{:g}; need 0 to below 90", slope_deg));
    file.scene.max_slope_rad = slope_deg * kRadPerDeg;
  }
  if (file.scene.shape == ReliefShape::kRipple) {
    file.scene.ripple_period_px = surface.Number("period_px");
    surface.Require(file.scene.ripple_period_px > 0.0, "period_px",
                    fmt::format("{:g}; need more than 0", file.scene.ripple_period_px));
  }
  JsonReader albedo = top.Object("albedo");
  file.scene.albedo_min = albedo.Number("min");
  file.scene.albedo_max = albedo.Number("max");
  albedo.Require(file.scene.albedo_min > 0.0 && file.scene.albedo_min <= file.scene.albedo_max &&
                     file.scene.albedo_max <= 1.0,
                 "min",
                 fmt::format("{:g} with max {:g}; need 0 < min <= max <= 1", file.scene.albedo_min,
                             file.scene.albedo_max));
  for (JsonReader* reader : {&surface, &albedo, &top}) {
    if (Status status = reader->Finish(); !status) {
      return tl::unexpected(status.error());
    }
  }
  Result<Rig> rig = ReadRig(path.parent_path() / rig_file);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  if (!rig->camera) {
    return Fail(ErrorCode::kBadData,
                "{}: the rig has no camera; need one, for the size of the frames",
                (path.parent_path() / rig_file).string());
  }
  file.rig = std::move(*rig);
  return file;
}

// The frames, the rig, the truth, and last the record.
Status StageSession(const SceneFile& file, const RenderedRelief& rendered, const Task& task,
                    OutputFolder& folder) {
  const std::string rig_json = RigToJson(file.rig);
  Status status = folder.WriteText("rig.json", rig_json);
  Session session;
  session.rig = "rig.json";
  session.rig_sha256 = Sha256(rig_json);
  task.BeginStage("writing", static_cast<int>(rendered.stack.size()));
  for (const LightFrame& frame : rendered.stack) {
    if (status) {
      status = task.CheckCancelled();
    }
    if (!status) {
      return status;
    }
    const std::string name = "frames/" + frame.name + ".exr";
    const std::filesystem::path staged = folder.Stage(name);
    status = WriteExr(staged, frame.rgb);
    if (status) {
      const Result<std::string> sha256 = Sha256OfFile(staged);
      if (!sha256) {
        return tl::unexpected(sha256.error());
      }
      session.frames.push_back({.light = frame.name, .file = name, .sha256 = *sha256});
    }
    task.Advance();
  }
  if (status) {
    status = WriteExr(folder.Stage("truth/normal.exr"), rendered.normal);
  }
  if (status) {
    status = WriteExr(folder.Stage("truth/albedo.exr"), rendered.albedo);
  }
  return status ? folder.WriteText("session.json", SessionToJson(session)) : status;
}

Result<SceneFile> Simulate(const SimulateArgs& args, const Task& task) {
  Result<SceneFile> file = ReadScene(args.scene);
  if (!file) {
    return file;
  }
  Result<OutputFolder> folder = OutputFolder::Open(args.output);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  const Result<RenderedRelief> rendered =
      RenderRelief(file->scene, file->rig, file->rig.camera->size_px, task);
  if (!rendered) {
    return tl::unexpected(rendered.error());
  }
  Status status = StageSession(*file, *rendered, task, *folder);
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
      "simulate", "Render a scene with known answers as a session (linear EXR frames)");
  cmd->add_option("scene", args.scene, "Scene file, as in samples/scenes")->required();
  cmd->add_option("-o,--output", args.output, "Folder for the session; made where missing")
      ->required();
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

int RunSimulate(const SimulateArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  const Result<SceneFile> file = Simulate(args, task.WithThreads(args.threads));
  task.ClearProgress();
  if (!file) {
    log << "sateen simulate: error: " << file.error().message << '\n';
    return ExitStatus(file.error());
  }
  const ImageSize size = file->rig.camera->size_px;
  out << fmt::format("rendered {} frames of {}x{} px, with truth, to {}\n", file->rig.lights.size(),
                     size.width, size.height, args.output.string());
  return 0;
}

}  // namespace sateen::cli
