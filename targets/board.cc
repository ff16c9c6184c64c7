#include "targets/board.h"

#include <algorithm>
#include <cmath>

#include "targets/marker_dictionary.h"
#include "targets/spec_text.h"

namespace sateen {
namespace {

constexpr int kFewestSquares = 3;
constexpr int kMostSquares = 100;
constexpr int kDefaultMarkerBits = 4;
constexpr std::string_view kBoardForms =
    "\"chessboard:9x6:24mm\" (inner corners, square) or "
    "\"charuco:10x7:25mm:18mm\" (squares, square, marker; then, if not the default, "
    "\":DICT_5X5_250\", \":legacy\")";

// Fields into numbers; false where they do not have the form.
bool ReadBoardFields(const std::vector<std::string_view>& fields, BoardSpec& spec) {
  if (fields.size() < 3 || !ReadGrid(fields[1], spec.columns, spec.rows) ||
      !ReadLength(fields[2], spec.square_mm)) {
    return false;
  }
  if (fields[0] == "chessboard") {
    spec.columns = std::min(spec.columns, kMostSquares) + 1;  // no overflow
    spec.rows = std::min(spec.rows, kMostSquares) + 1;
    return fields.size() == 3;
  }
  if (fields[0] != "charuco" || fields.size() < 4 || !ReadLength(fields[3], spec.marker_mm)) {
    return false;
  }
  spec.pattern = BoardPattern::kCharuco;
  size_t next = 4;
  if (next < fields.size() && fields[next].starts_with("DICT_")) {
    spec.dictionary = fields[next++];
  }
  if (next < fields.size() && fields[next] == "legacy") {
    spec.legacy = true;
    ++next;
  }
  return next == fields.size();
}

Status CheckMarkers(std::string_view text, BoardSpec& spec) {
  if (!(spec.marker_mm > 0.0 && spec.marker_mm < spec.square_mm)) {
    return Fail(ErrorCode::kInvalidArgument,
                "board '{}': markers of {} mm in squares of {} mm; need 0 < marker < square", text,
                spec.marker_mm, spec.square_mm);
  }
  const int needed = static_cast<int>(spec.MarkerCenters().size());
  if (spec.dictionary.empty()) {
    spec.dictionary = DictionaryFor(kDefaultMarkerBits, needed);
  }
  const Result<int> count = MarkerCount(spec.dictionary);
  if (!count) {
    return Fail(ErrorCode::kInvalidArgument, "board '{}': {}", text, count.error().message);
  }
  if (*count < needed) {
    return Fail(
        ErrorCode::kInvalidArgument,
        "board '{}': {} markers, and {} has {}; choose a larger dictionary or fewer squares", text,
        needed, spec.dictionary, *count);
  }
  return {};
}

}  // namespace

std::string BoardSpec::Text() const {
  if (pattern == BoardPattern::kChessboard) {
    return fmt::format("chessboard:{}x{}:{}mm", columns - 1, rows - 1, square_mm);
  }
  return fmt::format("charuco:{}x{}:{}mm:{}mm:{}{}", columns, rows, square_mm, marker_mm,
                     dictionary, legacy ? ":legacy" : "");
}

Eigen::Vector3d BoardSpec::CornerPoint(int id) const {
  const int column = id % (columns - 1) + 1;
  const int row = id / (columns - 1) + 1;
  return {(column - 0.5 * columns) * square_mm, (0.5 * rows - row) * square_mm, 0.0};
}

bool BoardSpec::IsBlack(int column, int row) const {
  const int first = legacy ? (rows - 1) % 2 : 0;  // 1 where the top left square is white
  return (column + row + first) % 2 == 0;
}

std::vector<Eigen::Vector3d> BoardSpec::MarkerCenters() const {
  std::vector<Eigen::Vector3d> centers;
  centers.reserve(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (!IsBlack(column, row)) {
        centers.emplace_back((column + 0.5 - 0.5 * columns) * square_mm,
                             (0.5 * rows - row - 0.5) * square_mm, 0.0);
      }
    }
  }
  return centers;
}

bool BoardSpec::IsSymmetric() const {
  return pattern == BoardPattern::kChessboard && (columns + rows) % 2 == 0;
}

Result<BoardSpec> ParseBoardSpec(std::string_view text) {
  BoardSpec spec;
  if (!ReadBoardFields(FieldsOf(text), spec)) {
    return Fail(ErrorCode::kInvalidArgument, "board '{}'; need {}", text, kBoardForms);
  }
  if (std::min(spec.columns, spec.rows) < kFewestSquares ||
      std::max(spec.columns, spec.rows) > kMostSquares) {
    return Fail(ErrorCode::kInvalidArgument,
                "board '{}': {} x {} squares; need {} to {} along each side", text, spec.columns,
                spec.rows, kFewestSquares, kMostSquares);
  }
  if (!(spec.square_mm > 0.0 && std::isfinite(spec.square_mm))) {
    return Fail(ErrorCode::kInvalidArgument, "board '{}': squares of {} mm; need a length > 0 mm",
                text, spec.square_mm);
  }
  if (spec.pattern == BoardPattern::kCharuco) {
    if (const Status markers = CheckMarkers(text, spec); !markers) {
      return tl::unexpected<Error>(markers.error());
    }
  }
  return spec;
}

}  // namespace sateen
