#include "scanner/sessions/files/pose_json.h"

#include <fmt/format.h>

#include "core/json.h"
#include "rig/plausible.h"

namespace sateen {
namespace {

constexpr double kRigidTolerance =
    1e-6;  // tolerance for a rotation written with nine digits or more
constexpr const char* kPoseKey = "table_from_target";

}  // namespace

std::optional<Eigen::Isometry3d> ReadTransform(JsonReader& json, std::string_view key) {
  const std::optional<std::vector<double>> numbers = json.OptionalNumbers(key, 16);
  if (!numbers) {
    return std::nullopt;
  }
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers->data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const bool is_rigid =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <=
          kRigidTolerance &&
      rotation.determinant() > 0.0 && matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1);
  json.Require(is_rigid, key,
               "is not a rigid motion; need a rotation, a translation and 0 0 0 1, by rows");
  const double farthest_mm = matrix.topRightCorner<3, 1>().cwiseAbs().maxCoeff();
  json.Require(
      farthest_mm <= kPlausiblePlace.most, key,
      fmt::format("moves by {:g} mm; need {:g} at most", farthest_mm, kPlausiblePlace.most));
  return Eigen::Isometry3d(matrix);
}

std::vector<double> RowMajor(const Eigen::Isometry3d& transform) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = transform.matrix();
  return {matrix.data(), matrix.data() + matrix.size()};
}

std::string TruePoseToJson(const Eigen::Isometry3d& table_from_target) {
  const nlohmann::ordered_json json{{"schema", "sateen.pose/1"},
                                    {kPoseKey, RowMajor(table_from_target)}};
  return JsonText(json, 2) + "\n";
}

Result<std::optional<Eigen::Isometry3d>> ReadTruePose(const std::filesystem::path& dir) {
  const std::filesystem::path path = dir / kTruePoseFile;
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) {
    return std::nullopt;
  }
  const Result<nlohmann::json> json = ReadJsonFile(path, "sateen.pose", 1);
  if (!json) {
    return tl::unexpected(json.error());
  }
  JsonReader reader(*json, path.string());
  std::optional<Eigen::Isometry3d> pose = ReadTransform(reader, kPoseKey);
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  return pose;
}

}  // namespace sateen
