#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/json.h"

namespace sateen {

// Reads 16 numbers, row-major, of a rigid motion; nothing where the key is absent. For .cc files
// only.
[[nodiscard]] std::optional<Eigen::Isometry3d> ReadTransform(JsonReader& json,
                                                             std::string_view key);
[[nodiscard]] std::vector<double> RowMajor(const Eigen::Isometry3d& transform);

// Where the sheet or the board of a simulated session lies: `kTruePoseFile` in its folder, schema
// sateen.pose/1.
constexpr const char* kTruePoseFile = "truth/pose.json";
[[nodiscard]] std::string TruePoseToJson(const Eigen::Isometry3d& table_from_target);
// Reads the true pose; nothing if there is no such file. kIo, kBadData: it cannot be read.
[[nodiscard]] Result<std::optional<Eigen::Isometry3d>> ReadTruePose(
    const std::filesystem::path& dir);

}  // namespace sateen
