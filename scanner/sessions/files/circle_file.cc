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
  for (const Circle& circle : circles) {
    if (!(circle.radius_px > 0.0)) {
      return Fail(ErrorCode::kBadData, "{}: a radius of {} px; need one above 0", path.string(),
                  circle.radius_px);
    }
  }
  return circles;
}

}  // namespace sateen
