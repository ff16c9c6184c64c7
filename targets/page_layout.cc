#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "targets/page.h"
#include "targets/paper.h"

namespace sateen {
namespace {

constexpr double kPageMarginMm = 5.0;  // which printers leave white
constexpr double kFooterMm = 14.0;     // ruler and text, within the margin
constexpr double kSlackMm = 1e-6;
constexpr std::array kPapersBySize = {"letter", "A4", "A3", "A2"};
constexpr std::array kRulersMm = {100.0, 50.0};

// Returns the room that a print may take on a paper.
Eigen::Vector2d RoomMm(const Eigen::Vector2d& paper_mm, bool is_sheet) {
  return is_sheet ? paper_mm
                  : Eigen::Vector2d(paper_mm.x() - 2.0 * kPageMarginMm,
                                    paper_mm.y() - 2.0 * kPageMarginMm - kFooterMm);
}

// Returns the paper, turned so that the print fits; as it is if the print fits without a turn.
std::optional<Eigen::Vector2d> FittingPaper(const Eigen::Vector2d& paper_mm, const Print& print,
                                            bool is_sheet) {
  for (const Eigen::Vector2d& turned : {paper_mm, Eigen::Vector2d(paper_mm.y(), paper_mm.x())}) {
    if ((print.SizeMm().array() <= RoomMm(turned, is_sheet).array() + kSlackMm).all()) {
      return turned;
    }
  }
  return std::nullopt;
}

// Returns how large the print could be on the paper, as a share of its size.
double LargestShare(const Eigen::Vector2d& paper_mm, const Print& print) {
  double largest = 0.0;
  for (const Eigen::Vector2d& turned : {paper_mm, Eigen::Vector2d(paper_mm.y(), paper_mm.x())}) {
    largest =
        std::max(largest, (RoomMm(turned, false).array() / print.SizeMm().array()).minCoeff());
  }
  return largest;
}

std::string WhatFits(const Eigen::Vector2d& paper_mm, const Print& print,
                     const std::optional<BoardSpec>& board) {
  std::vector<std::string> fits;
  for (const char* name : kPapersBySize) {
    if (FittingPaper(PaperSizeMm(name).value(), print, !board)) {
      fits.emplace_back(name);
    }
  }
  std::string text = fits.empty() ? "none of letter, A4, A3, A2 is large enough"
                                  : fmt::format("it fits on {}", fmt::join(fits, ", "));
  if (board) {
    const double square_mm = std::floor(board->square_mm * LargestShare(paper_mm, print));
    if (square_mm >= 1.0) {
      text += fmt::format("; on this paper squares of {:g} mm fit", square_mm);
    }
  }
  return text;
}

}  // namespace

Result<Page> LayOutPage(std::string_view spec, std::string_view paper) {
  const bool is_sheet = spec.starts_with("sheet");
  std::optional<BoardSpec> board;
  std::string text;
  std::string_view own_paper = "A4";
  Result<SheetBorder> border = SheetBorder();
  if (is_sheet) {
    border = ParseSheetBorder(spec);
    if (!border) {
      return tl::unexpected(border.error());
    }
    own_paper = border->paper;
    text = border->Text();
  } else {
    Result<BoardSpec> parsed = ParseBoardSpec(spec);
    if (!parsed) {
      return tl::unexpected(parsed.error());
    }
    text = parsed->Text();
    board = *std::move(parsed);
  }
  Print print = is_sheet ? PrintOf(*border) : PrintOf(*board);
  const std::string_view name = paper.empty() ? own_paper : paper;
  const Result<Eigen::Vector2d> paper_mm = PaperSizeMm(name);
  if (!paper_mm) {
    return tl::unexpected(paper_mm.error());
  }
  const std::optional<Eigen::Vector2d> turned = FittingPaper(*paper_mm, print, is_sheet);
  if (!turned) {
    return Fail(ErrorCode::kInvalidArgument, "{} is {:g} x {:g} mm and does not fit on {}{}; {}",
                text, print.SizeMm().x(), print.SizeMm().y(), name,
                is_sheet ? "" : " with its white rim and a ruler",
                WhatFits(*paper_mm, print, board));
  }
  Page page{.paper_mm = *turned, .print = std::move(print), .spec = text, .is_sheet = is_sheet};
  const double footer_mm = is_sheet ? 0.0 : kFooterMm;
  page.center_mm = 0.5 * (*turned - Eigen::Vector2d(0.0, footer_mm));
  // Beside a sheet that is to be cut out there may be room for a ruler too.
  const double below_mm = turned->y() - page.center_mm.y() - 0.5 * page.print.SizeMm().y();
  if (below_mm + kSlackMm >= kFooterMm) {
    const auto* const ruler = std::ranges::find_if(
        kRulersMm, [&](double length) { return length <= turned->x() - 2.0 * kPageMarginMm; });
    page.ruler_mm = ruler != kRulersMm.end() ? *ruler : 0.0;
  }
  return page;
}

}  // namespace sateen
