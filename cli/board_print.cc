#include "cli/board_print.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <ostream>

#include "core/files/output_folder.h"
#include "core/json.h"
#include "core/version.h"
#include "targets/page.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

Result<PageFormat> FormatOf(const fs::path& output) {
  const std::string extension = output.extension().string();
  if (extension == ".pdf") {
    return PageFormat::kPdf;
  }
  if (extension == ".svg") {
    return PageFormat::kSvg;
  }
  if (extension == ".png") {
    return PageFormat::kPng;
  }
  return Fail(ErrorCode::kInvalidArgument, "{}: unsupported file type; need .pdf, .svg or .png",
              output.string());
}

Result<Page> PrintBoard(const BoardPrintArgs& args) {
  const Result<PageFormat> format = FormatOf(args.output);
  if (!format) {
    return tl::unexpected(format.error());
  }
  Result<Page> page = LayOutPage(args.spec, args.paper);
  if (!page) {
    return page;
  }
  const Status written = DrawPage(*page, *format, args.dpi).and_then([&](const std::string& bytes) {
    return WriteFileWhole(args.output, bytes);
  });
  if (!written) {
    return tl::unexpected(written.error());
  }
  return page;
}

std::string TextReport(const BoardPrintArgs& args, const Page& page) {
  const Eigen::Vector2d size_mm = page.print.SizeMm();
  std::string text = fmt::format(
      "{}, {:g} x {:g} mm, on paper of {:g} x {:g} mm, is written to {}\n", page.spec, size_mm.x(),
      size_mm.y(), page.paper_mm.x(), page.paper_mm.y(), args.output.string());
  text += page.ruler_mm > 0.0
              ? fmt::format("print it at 100 %, then measure the ruler: {:g} mm\n", page.ruler_mm)
              : "print it at 100 %, then measure it against the line at its lower edge\n";
  return text;
}

std::string JsonReport(const BoardPrintArgs& args, const Page& page) {
  const auto pair = [](const Eigen::Vector2d& v) { return nlohmann::json{v.x(), v.y()}; };
  const nlohmann::json report = {{"schema", "sateen.board.print/1"},
                                 {"version", Version()},
                                 {"output", args.output.string()},
                                 {"target", page.spec},
                                 {"size_mm", pair(page.print.SizeMm())},
                                 {"paper_mm", pair(page.paper_mm)},
                                 {"ruler_mm", page.ruler_mm}};
  return JsonText(report) + "\n";
}

}  // namespace

void AddBoardPrint(CLI::App& board, BoardPrintArgs& args) {
  CLI::App* print = board.add_subcommand(
      "print", "Draw a board, or a sheet with a marker border, to be printed at its true size");
  print
      ->add_option("target", args.spec,
                   "chessboard:9x6:24mm (inner corners, square), charuco:10x7:25mm:18mm (squares, "
                   "square, marker) or sheet:A4:12mm (paper, marker)")
      ->required();
  print->add_option("--paper", args.paper,
                    "A4, A3, A2, letter or WIDTHxHEIGHTmm; default: A4, or the sheet's own");
  print->add_option("-o,--output", args.output, "File to write: .pdf, .svg or .png")->required();
  print->add_option("--dpi", args.dpi, "Resolution of a PNG in pixels per inch")
      ->check(CLI::Range(50.0, 1200.0))
      ->capture_default_str();
  print->add_flag("--json", args.json, "Print one JSON object on stdout instead of the text");
}

int RunBoardPrint(const BoardPrintArgs& args, const Task& task, std::ostream& out,
                  std::ostream& log) {
  Result<Page> page = task.CheckCancelled().and_then([&] { return PrintBoard(args); });
  if (!page) {
    log << "sateen board print: error: " << page.error().message << '\n';
    return ExitStatus(page.error());
  }
  out << (args.json ? JsonReport(args, *page) : TextReport(args, *page));
  return 0;
}

}  // namespace sateen::cli
