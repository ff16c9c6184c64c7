#include "targets/sheet_border.h"

#include <cmath>
#include <utility>

#include "targets/marker_dictionary.h"
#include "targets/paper.h"
#include "targets/spec_text.h"

namespace sateen {
namespace {

constexpr double kMarginMm = 5.0;          // which printers leave white
constexpr double kLeastGap = 0.4;          // between markers, of their side
constexpr double kLeastBlank = 1.0 / 3.0;  // share of the paper, each way
constexpr double kSmallestMarkerMm = 2.0;
constexpr int kFewestAlongASide = 3;
constexpr int kBits = 4;
constexpr double kQuiet = 1.0 / 6.0;  // share of a marker: white about it

// Markers along a side, and the distance of their centres.
struct Row {
  int count;
  double pitch_mm;
};

Row RowAlong(double side_mm, double marker_mm) {
  const double printed_mm = side_mm - 2.0 * kMarginMm;
  const double gap_mm = kLeastGap * marker_mm;
  const int count = static_cast<int>(std::floor((printed_mm + gap_mm) / (marker_mm + gap_mm)));
  return {count, (printed_mm - marker_mm) / std::max(count - 1, 1)};
}

}  // namespace

std::string SheetBorder::Text() const {
  return fmt::format("sheet:{}:{}mm:{}", paper, marker_mm, dictionary);
}

std::vector<Eigen::Vector3d> SheetBorder::MarkerCenters() const {
  const Row x = RowAlong(size_mm.x(), marker_mm);
  const Row y = RowAlong(size_mm.y(), marker_mm);
  const double right = 0.5 * (size_mm.x() - marker_mm) - kMarginMm;
  const double top = 0.5 * (size_mm.y() - marker_mm) - kMarginMm;
  std::vector<Eigen::Vector3d> centers;
  centers.reserve(2 * static_cast<size_t>(x.count + y.count));
  for (int i = 0; i < x.count; ++i) {
    centers.emplace_back(-right + i * x.pitch_mm, top, 0.0);
  }
  for (int i = 1; i < y.count; ++i) {
    centers.emplace_back(right, top - i * y.pitch_mm, 0.0);
  }
  for (int i = x.count - 2; i >= 0; --i) {
    centers.emplace_back(-right + i * x.pitch_mm, -top, 0.0);
  }
  for (int i = y.count - 2; i >= 1; --i) {
    centers.emplace_back(-right, top - i * y.pitch_mm, 0.0);
  }
  return centers;
}

Eigen::AlignedBox2d SheetBorder::BlankMm() const {
  const double rim_mm = kMarginMm + (1.0 + kQuiet) * marker_mm;
  const Eigen::Vector2d half = (0.5 * size_mm).array() - rim_mm;
  return {-half, half};
}

Result<SheetBorder> ParseSheetBorder(std::string_view text) {
  const std::vector<std::string_view> fields = FieldsOf(text);
  SheetBorder border;
  if (fields.size() < 3 || fields.size() > 4 || fields[0] != "sheet" ||
      !ReadLength(fields[2], border.marker_mm)) {
    return Fail(ErrorCode::kInvalidArgument,
                "sheet '{}'; need \"sheet:A4:12mm\" (paper, marker; then, if not the default, "
                "\":DICT_5X5_250\") or \"sheet:200x150mm:10mm\"",
                text);
  }
  const Result<Eigen::Vector2d> paper = PaperSizeMm(fields[1]);
  if (!paper) {
    return Fail(paper.error().code, "sheet '{}': {}", text, paper.error().message);
  }
  border.paper = fields[1];
  border.size_mm = *paper;
  if (!fields[1].ends_with("mm") && border.size_mm.y() > border.size_mm.x()) {
    std::swap(border.size_mm.x(), border.size_mm.y());
  }
  const Eigen::Vector2d blank_mm = border.BlankMm().sizes();
  if (!(border.marker_mm >= kSmallestMarkerMm &&
        (blank_mm.array() >= kLeastBlank * border.size_mm.array()).all())) {
    return Fail(ErrorCode::kInvalidArgument,
                "sheet '{}': markers of {} mm; need {} mm or more, and less than a third of the "
                "paper's short side for the two rows of them",
                text, border.marker_mm, kSmallestMarkerMm);
  }
  if (RowAlong(border.size_mm.minCoeff(), border.marker_mm).count < kFewestAlongASide) {
    return Fail(ErrorCode::kInvalidArgument,
                "sheet '{}': fewer than {} markers along a side; choose smaller ones", text,
                kFewestAlongASide);
  }
  const int needed = static_cast<int>(border.MarkerCenters().size());
  border.dictionary = fields.size() == 4 ? std::string(fields[3]) : DictionaryFor(kBits, needed);
  const Result<int> count = MarkerCount(border.dictionary);
  if (!count) {
    return Fail(ErrorCode::kInvalidArgument, "sheet '{}': {}", text, count.error().message);
  }
  if (*count < needed) {
    return Fail(ErrorCode::kInvalidArgument,
                "sheet '{}': {} markers, and {} has {}; choose a larger dictionary or larger "
                "markers",
                text, needed, border.dictionary, *count);
  }
  return border;
}

}  // namespace sateen
