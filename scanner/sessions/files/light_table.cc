#include "scanner/sessions/files/light_table.h"

#include <fmt/format.h>

#include "rig/rig.h"

namespace sateen {
namespace {

Result<Light> LightFromRow(const NumberRow& row, size_t index, LengthRange lengths) {
  Light light;
  light.name = fmt::format("light-{}", index);
  light.channel = static_cast<int>(index);
  const Eigen::Vector3d direction(row.values[0], row.values[1], row.values[2]);
  const double length = direction.norm();
  if (!(length >= lengths.least && length <= lengths.most)) {
    return Fail(ErrorCode::kBadData,
                "{}: the direction [{:.6g}, {:.6g}, {:.6g}] has length {:.6g}; need {} to {}",
                row.place, direction.x(), direction.y(), direction.z(), length, lengths.least,
                lengths.most);
  }
  light.direction = direction / length;
  if (row.values.size() == 6) {
    light.flux_rgb = Eigen::Vector3d(row.values[3], row.values[4], row.values[5]);
  }
  if (const Status status = light.Validate(row.place); !status) {
    return tl::unexpected(status.error());
  }
  return light;
}

// Lines of 3 or 6 numbers are lights, whatever their count; nothing else is ambiguous.
bool IsByColumns(const std::vector<NumberRow>& rows) {
  const size_t width = rows.empty() ? 0 : rows[0].values.size();
  return rows.size() == 3 && width > 1 && width != 3 && width != 6;
}

// Takes the line that holds the count alone, where there is one.
Status TakeCount(std::vector<NumberRow>& rows) {
  if (rows.empty() || rows[0].values.size() != 1) {
    return {};
  }
  const NumberRow first = rows[0];
  rows.erase(rows.begin());
  const size_t found = IsByColumns(rows) ? rows[0].values.size() : rows.size();
  if (first.values[0] != static_cast<double>(found)) {
    return Fail(ErrorCode::kBadData,
                "{}: the number of lights is {} but {} follow; correct one of them", first.place,
                first.values[0], found);
  }
  return {};
}

Status CheckRows(const std::vector<NumberRow>& rows) {
  const size_t width = rows[0].values.size();
  if (IsByColumns(rows)) {
    return CheckWidths(rows, width, "as many as in the first line, one column for each light");
  }
  if (width == 6) {
    return CheckWidths(rows, 6, "6 as in the first line: a direction and an RGB intensity");
  }
  return CheckWidths(rows, 3, "3 in every line (a direction), or 6 (and an RGB intensity)");
}

std::vector<NumberRow> Transposed(const std::vector<NumberRow>& rows, const std::string& file) {
  std::vector<NumberRow> columns;
  for (size_t k = 0; k < rows[0].values.size(); ++k) {
    columns.push_back({fmt::format("{}: column {}", file, k + 1),
                       {rows[0].values[k], rows[1].values[k], rows[2].values[k]}});
  }
  return columns;
}

}  // namespace

Status CheckWidths(const std::vector<NumberRow>& rows, size_t width, std::string_view needed) {
  for (const NumberRow& row : rows) {
    if (row.values.size() != width) {
      return Fail(ErrorCode::kBadData, "{}: found {} numbers; need {}", row.place,
                  row.values.size(), needed);
    }
  }
  return {};
}

Result<Lights> LightsFromRows(const std::vector<NumberRow>& rows, LengthRange lengths) {
  Lights lights;
  lights.reserve(rows.size());
  for (const NumberRow& row : rows) {
    Result<Light> light = LightFromRow(row, lights.size(), lengths);
    if (!light) {
      return tl::unexpected(light.error());
    }
    lights.push_back(*std::move(light));
  }
  if (!rows.empty()) {
    const std::string& place = rows.front().place;  // "lights.lp:2"
    const Rig rig{.lights = lights};
    if (const Status fit = rig.Validate(place.substr(0, place.rfind(':'))); !fit) {
      return tl::unexpected(fit.error());
    }
  }
  return lights;
}

Result<Lights> ReadLightTable(const std::filesystem::path& path,
                              std::map<std::string, std::string>& sha256_of_input) {
  Result<std::vector<NumberRow>> rows = ReadNumberRows(path, sha256_of_input);
  if (!rows) {
    return tl::unexpected(rows.error());
  }
  if (const Status status = TakeCount(*rows); !status) {
    return tl::unexpected(status.error());
  }
  if (rows->empty()) {
    return Fail(ErrorCode::kBadData, "{}: holds no lights; need a line 'x y z' for each",
                path.string());
  }
  if (const Status status = CheckRows(*rows); !status) {
    return tl::unexpected(status.error());
  }
  return LightsFromRows(IsByColumns(*rows) ? Transposed(*rows, path.string()) : *rows,
                        kUnitLengths);
}

}  // namespace sateen
