// Any bytes go for a scene, a chart and a pose. What is read from them is valid.
#include "core/json.h"
#include "fuzz/target.h"
#include "pipelines/simulate/scene_file.h"
#include "rig/rig.h"
#include "scanner/sessions/files/chart_file.h"
#include "scanner/sessions/files/pose_json.h"

namespace sateen::fuzz {

void Try(std::string_view bytes) {
  static const std::filesystem::path rig = FileOf("rig.json", kRigText);
  const std::filesystem::path path = FileOf("scene.json", bytes);
  if (const auto scene = ReadSceneFile(path)) {
    Need(scene->scene.Validate().has_value() && scene->sensor.Validate().has_value());
  }
  if (const auto chart = ReadChartFile(path)) {
    Need(chart->Validate("chart").has_value());
  }
}

}  // namespace sateen::fuzz
