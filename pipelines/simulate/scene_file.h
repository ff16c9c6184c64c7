#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/sessions/session.h"
#include "simulation/scene.h"
#include "simulation/sensor.h"

namespace sateen {

// Settings of the camera, for the record; the picture depends on sensor.full_scale alone.
struct ExposureRecord {
  double exposure_s = 0.02;
  double f_number = 8.0;
  double iso = 100.0;
  // Exposure times of a chart, each as bright as its time says; empty: exposure_s alone.
  std::vector<double> series_s = {};
  std::string series_light;  // light that has the series; empty: all
  int repeats = 1;           // frames of each kind
};

struct SceneFile {
  std::optional<Eigen::Isometry3d> table_from_target;  // pose of a sheet, board or chart
  Scene scene;
  std::vector<std::filesystem::path> inputs;  // the scene file and the rig
  std::string title;
  ExposureRecord exposure;
  Sensor sensor;
  SessionKind kind = SessionKind::kFabric;
  bool target_is_printed = false;  // so that frames tell its pose, and their record need not
};

/// Reads a scene file, schema sateen.scene/1 (docs/simulation.md).
///
/// Errors   kIo: the file, its rig or its height map is absent or unreadable
///          kBadData: a key that is missing, unknown or out of range, with the range
[[nodiscard]] Result<SceneFile> ReadSceneFile(const std::filesystem::path& path);

}  // namespace sateen
