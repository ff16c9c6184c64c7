#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/error.h"
#include "imaging/image.h"
#include "targets/print.h"

namespace sateen {

// A print on paper, in its size.
struct Page {
  Eigen::Vector2d paper_mm = Eigen::Vector2d::Zero();  // as it is printed: upright or on its side
  // Centre of the print; right and down from the top left corner of the paper.
  Eigen::Vector2d center_mm = Eigen::Vector2d::Zero();
  Print print;
  std::string spec;       // full spec of the print
  bool is_sheet = false;  // a sheet, which is to be cut out where the paper is larger
  double ruler_mm = 0.0;  // to check the printer's scale; 0: no room for one
};

/// Lays the target `spec` (a board or a sheet, targets/print.h) on paper, upright or on its side,
/// with 5 mm of white about a board, and below it a ruler, what it is and how to print it. A sheet
/// lies alone on paper of its own size, or on a larger one with marks where to cut it out.
///
/// paper    as PaperSizeMm() reads it; empty: A4, or the paper of a sheet
/// Errors   kInvalidArgument: as PrintNamed() and PaperSizeMm(); a target that does not fit, with
///          the papers on which it does and the largest squares that would
[[nodiscard]] Result<Page> LayOutPage(std::string_view spec, std::string_view paper);

enum class PageFormat { kPdf, kSvg, kPng };

/// Returns the page as the bytes of a file, drawn by cairo; the same for the same page. A PNG has
/// `dpi` pixels per inch.
///
/// Errors   kIo: what cairo says
[[nodiscard]] Result<std::string> DrawPage(const Page& page, PageFormat format, double dpi = 300.0);

// Returns the page as grey levels; the top left corner of the paper is that of pixel (0, 0).
[[nodiscard]] Image<uint8_t> PageImage(const Page& page, double dpi);

}  // namespace sateen
