// Any bytes go for a scene, a chart and a pose. What is read from them is valid.
#include "fuzz/target.h"
#include "pipelines/simulate/scene_file.h"
#include "scanner/sessions/files/chart_file.h"
#include "scanner/sessions/files/pose_json.h"

namespace sateen::fuzz {
namespace {

constexpr std::string_view kRig = R"({
  "schema": "sateen.rig/1",
  "camera": {"model": "a", "size_px": [64, 48], "k": [195, 190, 31.5, 23],
             "distortion": [0, 0, 0, 0, 0],
             "table_from_camera": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 610, 0, 0, 0, 1]},
  "lights": [{"name": "led-0", "channel": 0, "model": "near", "position_mm": [400, 0, 420],
              "flux_rgb": [0.36, 0.36, 0.36]}]})";

}  // namespace

void Try(std::string_view bytes) {
  static const std::filesystem::path rig = FileOf("rig.json", kRig);
  const std::filesystem::path path = FileOf("scene.json", bytes);
  if (const auto scene = ReadSceneFile(path)) {
    Need(scene->scene.Validate().has_value() && scene->sensor.Validate().has_value());
  }
  if (const auto chart = ReadChartFile(path)) {
    Need(chart->Validate("chart").has_value());
  }
  FileOf(kTruePoseFile, bytes);
  if (const auto pose = ReadTruePose(Folder()); pose && *pose) {
    FileOf(kTruePoseFile, TruePoseToJson(**pose));
    Need(ReadTruePose(Folder()).has_value());
  }
}

}  // namespace sateen::fuzz
