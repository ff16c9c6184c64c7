#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "calibration/print/board_find.h"
#include "cli/board_print.h"
#include "targets/page.h"
#include "tests/calibration/test_pictures.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen::board_test {
namespace {

using sateen::testing::GreyFile;
using sateen::testing::RunResult;
using sateen::testing::TempFolder;
using ::testing::HasSubstr;

RunResult Board(std::vector<std::string> words) {
  words.insert(words.begin(), "print");
  return sateen::testing::RunCommand<cli::BoardPrintArgs>(std::move(words), cli::AddBoardPrint,
                                                          cli::RunBoardPrint);
}

// The printed board is the one that is looked for, corner by corner, and a millimetre is a
// millimetre.
TEST(BoardPrint, TheBoardIsFoundInItsPictureInItsSize) {
  const TempFolder folder;
  for (const char* text : {"charuco:10x7:25mm:18mm", "chessboard:9x6:24mm",
                           "charuco:9x8:20mm:15mm:DICT_5X5_100:legacy"}) {
    const std::string path = (folder.Path() / "board.png").string();
    const RunResult run = Board({text, "--paper", "A4", "-o", path, "--dpi", "127", "--json"});
    ASSERT_EQ(run.exit_status, 0) << run.log;
    EXPECT_EQ(run.Json().at("schema"), "sateen.board.print/1");
    const BoardSpec spec = ParseBoardSpec(text).value();
    const Result<BoardView> view = FindBoard(GreyFile(path), spec);
    ASSERT_TRUE(view) << text << ": " << view.error().message;
    EXPECT_EQ(view->ids.size(), static_cast<size_t>(spec.CornerCount())) << text;
    const Page page = LayOutPage(text, "A4").value();
    double worst_px = 0.0;
    for (size_t i = 0; i < view->ids.size(); ++i) {
      const Eigen::Vector2d at = spec.CornerPoint(view->ids[i]).head<2>();
      const Eigen::Vector2d px =
          5.0 * (page.center_mm + Eigen::Vector2d(at.x(), -at.y())) - Eigen::Vector2d(0.5, 0.5);
      worst_px = std::max(worst_px, (view->corners_px[i] - px).norm());
    }
    fmt::print("{}: {} corners, worst {:.3f} px of 0.2 mm\n", text, view->ids.size(), worst_px);
    EXPECT_LT(worst_px, 0.1) << text;
  }
}

TEST(BoardPrint, FilesAreWrittenByTheirEnding) {
  const TempFolder folder;
  for (const char* name : {"a.pdf", "a.svg", "a.png"}) {
    const std::string path = (folder.Path() / name).string();
    const RunResult run = Board({"sheet:A4:12mm", "-o", path});
    EXPECT_EQ(run.exit_status, 0) << run.log;
    EXPECT_THAT(run.out, HasSubstr("print it at 100 %"));
    EXPECT_GT(std::filesystem::file_size(path), 1000U);
  }
  const RunResult other = Board({"sheet:A4:12mm", "-o", (folder.Path() / "a.doc").string()});
  EXPECT_EQ(other.exit_status, 2);
  EXPECT_THAT(other.log, HasSubstr("need .pdf, .svg or .png"));
  const RunResult wide =
      Board({"charuco:10x7:30mm:20mm", "-o", (folder.Path() / "b.pdf").string()});
  EXPECT_EQ(wide.exit_status, 2);
  EXPECT_THAT(wide.log, HasSubstr("it fits on A3"));
  EXPECT_FALSE(std::filesystem::exists(folder.Path() / "b.pdf"));
  EXPECT_EQ(Board({"sheet:A4:12mm", "-o", "/no/such/folder/a.pdf"}).exit_status, 4);
}

}  // namespace
}  // namespace sateen::board_test
