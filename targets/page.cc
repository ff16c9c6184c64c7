#include "targets/page.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "core/check.h"

namespace sateen {
namespace {

constexpr double kMmPerInch = 25.4;
constexpr double kPointsPerMm = 72.0 / kMmPerInch;
constexpr double kTextMm = 2.6;
constexpr double kSmallTextMm = 1.5;  // in the margin of a sheet
constexpr double kLineMm = 0.2;
constexpr double kBottomMm = 6.0;  // from the paper's edge to the lowest text
constexpr double kCutMarkMm = 4.0;
constexpr double kTickMm = 10.0;
constexpr const char* kFixedDate = "2000-01-01T00:00:00Z";  // the same page, the same bytes

struct DestroySurface {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
struct DestroyContext {
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};
using SurfacePtrC = std::unique_ptr<cairo_surface_t, DestroySurface>;
using ContextPtr = std::unique_ptr<cairo_t, DestroyContext>;

cairo_status_t Append(void* bytes, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

// Shows the text centred on x, smaller where it would not fit `width_mm`; y is its base line.
void ShowText(cairo_t* cr, const std::string& text, double size_mm, double width_mm, double x,
              double y) {
  cairo_text_extents_t extents;
  cairo_set_font_size(cr, size_mm);
  cairo_text_extents(cr, text.c_str(), &extents);
  const double shrink = std::min(1.0, width_mm / std::max(extents.x_advance, 1e-9));
  cairo_set_font_size(cr, size_mm * shrink);
  cairo_move_to(cr, x - 0.5 * extents.x_advance * shrink, y);
  cairo_show_text(cr, text.c_str());
}

void DrawRuler(cairo_t* cr, const Page& page, double y) {
  const double left = 0.5 * (page.paper_mm.x() - page.ruler_mm);
  const int ticks = static_cast<int>(page.ruler_mm / kTickMm);
  for (int tick = 0; tick <= ticks; ++tick) {
    const double at = tick * kTickMm;
    const bool is_end = tick == 0 || tick == ticks;
    cairo_move_to(cr, left + at, y - (is_end ? 3.0 : 1.5));
    cairo_line_to(cr, left + at, y);
  }
  cairo_move_to(cr, left, y);
  cairo_line_to(cr, left + page.ruler_mm, y);
  cairo_stroke(cr);
}

// Draws marks at each corner of a sheet, outside of it.
void DrawCutMarks(cairo_t* cr, const Page& page) {
  const Eigen::Vector2d half = 0.5 * page.print.SizeMm();
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      const Eigen::Vector2d corner = page.center_mm + half.cwiseProduct(Eigen::Vector2d(x, y));
      cairo_move_to(cr, corner.x() + x, corner.y());
      cairo_line_to(cr, corner.x() + x * (1.0 + kCutMarkMm), corner.y());
      cairo_move_to(cr, corner.x(), corner.y() + y);
      cairo_line_to(cr, corner.x(), corner.y() + y * (1.0 + kCutMarkMm));
    }
  }
  cairo_stroke(cr);
}

std::string InstructionOf(const Page& page) {
  if (page.ruler_mm > 0.0) {
    return fmt::format("Print at 100 %, not fitted to the page: the ruler is {:g} mm long.",
                       page.ruler_mm);
  }
  Eigen::AlignedBox2d black;
  for (const Eigen::AlignedBox2d& box : page.print.BlackMm()) {
    black.extend(box);
  }
  return fmt::format("Print at 100 %, not fitted to the page: what is black spans {:g} x {:g} mm.",
                     black.sizes().x(), black.sizes().y());
}

// Draws in millimetres, right and down from the paper's top left corner.
void Draw(cairo_t* cr, const Page& page) {
  cairo_set_source_rgb(cr, 1.0, 1.0, 1.0);
  cairo_paint(cr);
  cairo_set_source_rgb(cr, 0.0, 0.0, 0.0);
  // One path: boxes filled one by one would leave hairlines where they meet.
  for (const Eigen::AlignedBox2d& box : page.print.BlackMm()) {
    cairo_rectangle(cr, page.center_mm.x() + box.min().x(), page.center_mm.y() - box.max().y(),
                    box.sizes().x(), box.sizes().y());
  }
  cairo_fill(cr);
  cairo_select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_line_width(cr, kLineMm);
  const double middle = 0.5 * page.paper_mm.x();
  const double bottom = page.paper_mm.y() - kBottomMm;
  const std::string text = page.spec + "    " + InstructionOf(page);
  if (page.ruler_mm > 0.0) {
    DrawRuler(cr, page, bottom - 1.8 * kTextMm);
    ShowText(cr, text, kTextMm, page.paper_mm.x() - 2.0 * kBottomMm, middle, bottom);
  } else if (page.is_sheet) {
    // Within the margin, as far from the markers as letters are high.
    ShowText(cr, text, kSmallTextMm, page.print.SizeMm().x() - 2.0 * kBottomMm, middle,
             page.center_mm.y() + 0.5 * page.print.SizeMm().y() - kSmallTextMm);
  }
  if (page.is_sheet && page.paper_mm != page.print.SizeMm()) {
    DrawCutMarks(cr, page);
  }
}

Status DrawOn(cairo_surface_t* surface, const Page& page, double units_per_mm) {
  const ContextPtr context(cairo_create(surface));
  cairo_scale(context.get(), units_per_mm, units_per_mm);
  Draw(context.get(), page);
  cairo_show_page(context.get());
  const cairo_status_t status = cairo_status(context.get());
  if (status != CAIRO_STATUS_SUCCESS) {
    return Fail(ErrorCode::kIo, "cairo cannot draw the page: {}", cairo_status_to_string(status));
  }
  return {};
}

SurfacePtrC ImageSurface(const Page& page, double dpi) {
  const Eigen::Vector2d size_px = page.paper_mm * dpi / kMmPerInch;
  return SurfacePtrC(cairo_image_surface_create(CAIRO_FORMAT_RGB24,
                                                static_cast<int>(std::lround(size_px.x())),
                                                static_cast<int>(std::lround(size_px.y()))));
}

}  // namespace

Result<std::string> DrawPage(const Page& page, PageFormat format, double dpi) {
  std::string bytes;
  const Eigen::Vector2d size_pt = page.paper_mm * kPointsPerMm;
  SurfacePtrC surface;
  double units_per_mm = kPointsPerMm;
  if (format == PageFormat::kPdf) {
    surface.reset(cairo_pdf_surface_create_for_stream(Append, &bytes, size_pt.x(), size_pt.y()));
    cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, kFixedDate);
    cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, page.spec.c_str());
  } else if (format == PageFormat::kSvg) {
    surface.reset(
        cairo_svg_surface_create_for_stream(Append, &bytes, page.paper_mm.x(), page.paper_mm.y()));
    cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_MM);
    units_per_mm = 1.0;
  } else {
    surface = ImageSurface(page, dpi);
    units_per_mm = dpi / kMmPerInch;
  }
  if (Status status = DrawOn(surface.get(), page, units_per_mm); !status) {
    return tl::unexpected(status.error());
  }
  cairo_status_t status = CAIRO_STATUS_SUCCESS;
  if (format == PageFormat::kPng) {
    status = cairo_surface_write_to_png_stream(surface.get(), Append, &bytes);
  } else {
    cairo_surface_finish(surface.get());
    status = cairo_surface_status(surface.get());
  }
  if (status != CAIRO_STATUS_SUCCESS) {
    return Fail(ErrorCode::kIo, "cairo cannot write the page: {}", cairo_status_to_string(status));
  }
  return bytes;
}

Image<uint8_t> PageImage(const Page& page, double dpi) {
  const SurfacePtrC surface = ImageSurface(page, dpi);
  SATEEN_CHECK(DrawOn(surface.get(), page, dpi / kMmPerInch).has_value());
  cairo_surface_flush(surface.get());
  Image<uint8_t> grey(cairo_image_surface_get_width(surface.get()),
                      cairo_image_surface_get_height(surface.get()));
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int y = 0; y < grey.height; ++y) {
    for (int x = 0; x < grey.width; ++x) {
      grey.At(x, y) =
          data[static_cast<ptrdiff_t>(y) * stride + ptrdiff_t{4} * x];  // black and white alone
    }
  }
  return grey;
}

}  // namespace sateen
