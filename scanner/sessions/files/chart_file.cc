#include "scanner/sessions/files/chart_file.h"

#include <utility>

#include "core/json.h"

namespace sateen {

Result<Chart> ReadChartFile(const std::filesystem::path& path) {
  const Result<nlohmann::json> file = ReadJsonFile(path, "sateen.chart", 1);
  if (!file) {
    return tl::unexpected(file.error());
  }
  JsonReader reader(*file, path.string());
  Chart chart;
  chart.title = reader.OptionalString("title").value_or("");
  chart.patch_mm = reader.Number("patch_mm");
  std::vector<JsonReader> patches = reader.Objects("patches");
  if (Status status = reader.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  for (JsonReader& one : patches) {
    ChartPatch patch;
    patch.name = one.String("name");
    patch.reflectance_rgb = Eigen::Vector3d(one.Numbers("reflectance_rgb", 3).data());
    patch.center_mm = Eigen::Vector2d(one.Numbers("center_mm", 2).data());
    if (Status status = one.Finish(); !status) {
      return tl::unexpected(status.error());
    }
    chart.patches.push_back(std::move(patch));
  }
  if (Status status = chart.Validate(path.string()); !status) {
    return tl::unexpected(status.error());
  }
  return chart;
}

}  // namespace sateen
