#include "scanner/sessions/lp_layout.h"

#include <algorithm>

#include "scanner/sessions/files/light_table.h"
#include "scanner/sessions/files/text_table.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr LengthRange kDomeLengths = {1e-3, 1e6};  // positions on a dome, in any unit

// Finds a named image on this machine: often the name is the author's path, of either system.
Result<fs::path> FindImage(const std::string& name, const fs::path& dir, std::string_view place) {
  std::string slashed = name;
  std::replace(slashed.begin(), slashed.end(), '\\', '/');
  const fs::path last = fs::path(slashed).filename();
  for (const fs::path& candidate : {dir / name, dir / slashed, dir / last}) {
    std::error_code ignored;
    if (fs::is_regular_file(candidate, ignored)) {
      return candidate;
    }
  }
  return Fail(ErrorCode::kBadData, "{}: found neither the image {} nor {}; need one of them", place,
              name, (dir / last).string());
}

// Adds the image to the plan and gives its direction back.
Result<NumberRow> ReadLine(const TextLine& line, const fs::path& lp_file, ReadPlan& plan) {
  const std::string place = PlaceOf(lp_file, line.number);
  const std::vector<std::string_view> words = SplitWords(line.text);
  if (words.size() < 4) {
    return Fail(ErrorCode::kBadData, "{}: found {} words; need 'filename x y z'", place,
                words.size());
  }
  Result<NumberRow> row = ParseNumbers({words.end() - 3, words.end()}, place);
  if (!row) {
    return row;
  }
  // All that stands before the numbers is the name.
  const std::string_view last = words[words.size() - 4];
  const auto length = static_cast<size_t>(last.data() + last.size() - line.text.data());
  Result<fs::path> image = FindImage(line.text.substr(0, length), lp_file.parent_path(), place);
  if (!image) {
    return tl::unexpected(image.error());
  }
  plan.lit.emplace_back(1, FrameFile{*std::move(image), 1.0, std::nullopt});
  return row;
}

Status CheckCount(const std::vector<TextLine>& lines, const fs::path& lp_file) {
  if (lines.empty()) {
    return Fail(ErrorCode::kBadData, "{}: the file is empty; need the number of lights",
                lp_file.string());
  }
  const std::string place = PlaceOf(lp_file, lines[0].number);
  const Result<NumberRow> count = ParseNumbers(SplitWords(lines[0].text), place);
  if (!count) {
    return tl::unexpected(count.error());
  }
  if (count->values.size() != 1) {
    return Fail(ErrorCode::kBadData, "{}: found {} numbers; need one, the number of lights", place,
                count->values.size());
  }
  const size_t found = lines.size() - 1;
  if (found == 0 || count->values[0] != static_cast<double>(found)) {
    return Fail(ErrorCode::kBadData,
                "{}: the number of lights is {} but {} follow; correct one of them", place,
                count->values[0], found);
  }
  return {};
}

// Lamps at a finite distance are read as if they were far away: the unit is not in the file.
void WarnOfPositions(const std::vector<NumberRow>& rows, ReadPlan& plan) {
  const auto is_position = [](const NumberRow& row) {
    const double length = Eigen::Vector3d(row.values[0], row.values[1], row.values[2]).norm();
    return length < kUnitLengths.least || length > kUnitLengths.most;
  };
  const auto count = std::count_if(rows.begin(), rows.end(), is_position);
  if (count > 0) {
    plan.warnings.push_back(fmt::format(
        "{} of {} lights are given by a position, not by a unit vector; their distance, in an "
        "unknown unit, is ignored and they are treated as distant lights",
        count, rows.size()));
  }
}

}  // namespace

Result<ReadPlan> PlanLp(const fs::path& lp_file) {
  ReadPlan plan;
  plan.layout = "lp";
  const Result<std::vector<TextLine>> lines = ReadTextLines(lp_file, plan.sha256_of_input);
  if (!lines) {
    return tl::unexpected(lines.error());
  }
  if (const Status status = CheckCount(*lines, lp_file); !status) {
    return tl::unexpected(status.error());
  }
  std::vector<NumberRow> rows;
  for (size_t i = 1; i < lines->size(); ++i) {
    Result<NumberRow> row = ReadLine((*lines)[i], lp_file, plan);
    if (!row) {
      return tl::unexpected(row.error());
    }
    rows.push_back(*std::move(row));
  }
  Result<Lights> lights = LightsFromRows(rows, kDomeLengths);
  if (!lights) {
    return tl::unexpected(lights.error());
  }
  plan.rig.lights = *std::move(lights);
  WarnOfPositions(rows, plan);
  return plan;
}

}  // namespace sateen
