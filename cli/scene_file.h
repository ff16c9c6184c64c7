#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/session.h"
#include "simulation/scene.h"
#include "simulation/sensor.h"

namespace sateen::cli {

// How the camera was set, for the record; what it does to the picture is sensor.full_scale.
struct ExposureRecord {
  double exposure_s = 0.02;
  double f_number = 8.0;
  double iso = 100.0;
};

struct SceneFile {
  std::string title;
  SessionKind kind = SessionKind::kFabric;
  Scene scene;
  Sensor sensor;
  ExposureRecord exposure;
  std::vector<std::filesystem::path> inputs;          // the scene file and the rig
  std::optional<Eigen::Isometry3d> table_from_sheet;  // of a sheet: the plane that was rendered
};

/// Reads a scene file, schema sateen.scene/1 (docs/simulation.md).
///
/// Errors   kIo: the file, its rig or its height map is absent or unreadable
///          kBadData: a key that is missing, unknown or out of range, with the range
[[nodiscard]] Result<SceneFile> ReadSceneFile(const std::filesystem::path& path);

}  // namespace sateen::cli
