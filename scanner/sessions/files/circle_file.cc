#include "scanner/sessions/files/circle_file.h"

#include <algorithm>

#include "scanner/sessions/files/light_table.h"
#include "scanner/sessions/files/text_table.h"

namespace sateen {

Result<std::vector<Circle>> ReadCircles(const std::filesystem::path& path, ImageSize size,
                                        std::map<std::string, std::string>& sha256_of_input) {
  const Result<std::vector<NumberRow>> rows = ReadNumberRows(path, sha256_of_input);
  if (!rows) {
    return tl::unexpected(rows.error());
  }
  const auto single = [](const NumberRow& row) { return row.values.size() == 1; };
  const bool y_up = !rows->empty() && rows->size() % 3 == 0 && std::ranges::all_of(*rows, single);
  if (rows->empty()) {
    return Fail(ErrorCode::kBadData, "{}: is empty; need a line 'x y radius' for each sphere",
                path.string());
  }
  std::vector<Circle> circles;
  if (y_up) {
    for (size_t i = 0; i < rows->size(); i += 3) {
      const auto value = [&](size_t k) { return (*rows)[i + k].values[0]; };
      circles.push_back({{value(0) - 1.0, size.height - value(1)}, value(2)});
    }
  } else {
    if (Status status = CheckWidths(*rows, 3, "3: x y radius"); !status) {
      return tl::unexpected(status.error());
    }
    for (const NumberRow& row : *rows) {
      circles.push_back({{row.values[0], row.values[1]}, row.values[2]});
    }
  }
  if (circles.size() > kMaxCircles) {
    return Fail(ErrorCode::kBadData, "{}: {} circles; need at most {}", path.string(),
                circles.size(), kMaxCircles);
  }
  for (const Circle& circle : circles) {
    const double r = circle.radius_px;
    const auto inside = [](double center, int side) { return center >= 0.0 && center < side; };
    if (!(r > 0.0 && r <= std::max(size.width, size.height)) ||
        !inside(circle.center_px.x(), size.width) || !inside(circle.center_px.y(), size.height)) {
      return Fail(ErrorCode::kBadData,
                  "{}: a circle about ({:.6g}, {:.6g}) of radius {:.6g} px; need one inside the "
                  "picture of {} x {} px",
                  path.string(), circle.center_px.x(), circle.center_px.y(), r, size.width,
                  size.height);
    }
  }
  return circles;
}

}  // namespace sateen
