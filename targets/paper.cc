#include "targets/paper.h"

#include <algorithm>
#include <array>
#include <utility>

#include "targets/spec_text.h"

namespace sateen {
namespace {

constexpr double kShortestMm = 20.0;
constexpr double kLongestMm = 2000.0;

struct Paper {
  std::string_view name;
  double width_mm;
  double height_mm;
};
constexpr std::array<Paper, 4> kPapers = {{{"A4", 210.0, 297.0},  // ISO 216
                                           {"A3", 297.0, 420.0},
                                           {"A2", 420.0, 594.0},
                                           {"letter", 215.9, 279.4}}};  // ANSI A

}  // namespace

Result<Eigen::Vector2d> PaperSizeMm(std::string_view name) {
  const auto* const known = std::ranges::find(kPapers, name, &Paper::name);
  if (known != kPapers.end()) {
    return Eigen::Vector2d(known->width_mm, known->height_mm);
  }
  Eigen::Vector2d size_mm;
  if (!ReadSize(name, size_mm)) {
    return Fail(ErrorCode::kInvalidArgument,
                "paper '{}'; need A4, A3, A2, letter, or a size such as 200x150mm", name);
  }
  if (!(size_mm.minCoeff() >= kShortestMm && size_mm.maxCoeff() <= kLongestMm)) {
    return Fail(ErrorCode::kInvalidArgument, "paper '{}'; need {} to {} mm along each side", name,
                kShortestMm, kLongestMm);
  }
  return size_mm;
}

}  // namespace sateen
