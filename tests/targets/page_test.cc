#include "targets/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sateen::page_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr double kDpi = 254.0;  // 10 px a millimetre

// Every pixel of the page whose centre lies in the print's place is as the print says.
void ExpectPrintInItsPlace(const Page& page) {
  const Image<uint8_t> image = PageImage(page, kDpi);
  EXPECT_EQ(image.width, std::lround(10.0 * page.paper_mm.x()));
  EXPECT_EQ(image.height, std::lround(10.0 * page.paper_mm.y()));
  const Eigen::Vector2d half = 0.5 * page.print.SizeMm();
  int wrong = 0;
  int looked = 0;
  const double rim = page.is_sheet ? 4.0 : 0.0;  // where a sheet has its line of text
  for (int y = 3; y < image.height; y += 7) {
    for (int x = 3; x < image.width; x += 7) {
      const Eigen::Vector2d on_paper(0.1 * (x + 0.5), 0.1 * (y + 0.5));
      const Eigen::Vector2d at(on_paper.x() - page.center_mm.x(),
                               page.center_mm.y() - on_paper.y());
      if ((at.array().abs() < half.array() - rim).all()) {
        const uint8_t value = image.At(x, y);
        wrong += value > 60 && value < 195 ? 0 : (value < 128) != page.print.IsBlackAt(at);
        ++looked;
      }
    }
  }
  EXPECT_GT(looked, 10000);
  EXPECT_EQ(wrong, 0) << page.spec;
}

TEST(Page, PrintsAreInTheirSizeAndPlace) {
  for (const char* spec : {"charuco:10x7:25mm:18mm", "chessboard:5x8:20.5mm", "sheet:A4:12mm"}) {
    const Result<Page> page = LayOutPage(spec, "");
    ASSERT_TRUE(page) << page.error().message;
    ExpectPrintInItsPlace(*page);
  }
}

TEST(Page, PaperIsTurnedWhereNeeded) {
  EXPECT_EQ(LayOutPage("charuco:10x7:25mm:18mm", "A4").value().paper_mm, Eigen::Vector2d(297, 210));
  EXPECT_EQ(LayOutPage("charuco:7x10:25mm:18mm", "A4").value().paper_mm, Eigen::Vector2d(210, 297));
  EXPECT_EQ(LayOutPage("sheet:A4:12mm", "").value().paper_mm, Eigen::Vector2d(297, 210));
  EXPECT_EQ(LayOutPage("sheet:200x150mm:10mm", "A4").value().paper_mm, Eigen::Vector2d(210, 297));
  EXPECT_EQ(LayOutPage("sheet:200x150mm:10mm", "A4").value().ruler_mm, 100.0);
  EXPECT_EQ(LayOutPage("sheet:A4:12mm", "").value().ruler_mm, 0.0);
}

// The ruler: a line of its length, dark from end to end, white beyond, below the print.
TEST(Page, TheRulerHasItsLength) {
  const Page page = LayOutPage("charuco:10x7:25mm:18mm", "A4").value();
  ASSERT_EQ(page.ruler_mm, 100.0);
  const Image<uint8_t> image = PageImage(page, kDpi);
  int rows = 0;
  for (int y = static_cast<int>(10.0 * (page.center_mm.y() + 0.5 * page.print.SizeMm().y())) + 5;
       y < image.height; ++y) {
    int longest = 0;
    int run = 0;
    for (int x = 0; x < image.width; ++x) {
      run = image.At(x, y) < 128 ? run + 1 : 0;
      longest = std::max(longest, run);
    }
    if (longest > 500) {
      ++rows;
      EXPECT_NEAR(longest, 1002, 2);  // ends drawn 0.1 mm to each side
    }
  }
  EXPECT_GE(rows, 1);
}

TEST(Page, FilesAreOfTheirKindAndTheSameEachTime) {
  const Page page = LayOutPage("chessboard:5x4:20mm", "A4").value();
  const std::string pdf = DrawPage(page, PageFormat::kPdf).value();
  EXPECT_THAT(pdf, StartsWith("%PDF"));
  EXPECT_EQ(pdf, DrawPage(page, PageFormat::kPdf).value());
  EXPECT_THAT(pdf, HasSubstr("/MediaBox [ 0 0 595.275591 841.889764 ]"));  // 210 x 297 mm in points
  const std::string svg = DrawPage(page, PageFormat::kSvg).value();
  EXPECT_THAT(svg, HasSubstr("width=\"210mm\" height=\"297mm\""));
  EXPECT_THAT(DrawPage(page, PageFormat::kPng, 100.0).value(), StartsWith("\x89PNG"));
}

TEST(Page, SaysWhatFits) {
  const auto message = [](const char* spec, const char* paper) {
    return LayOutPage(spec, paper).error().message;
  };
  EXPECT_THAT(message("charuco:10x7:30mm:22mm", "A4"),
              HasSubstr("charuco:10x7:30mm:22mm:DICT_4X4_50 is 300 x 210 mm and does not fit on A4 "
                        "with its white rim and a ruler; it fits on A3, A2; on this paper squares "
                        "of 26 mm fit"));
  EXPECT_THAT(message("sheet:A3:12mm", "A4"), HasSubstr("does not fit on A4; it fits on A3, A2"));
  EXPECT_THAT(message("chessboard:9x6:90mm", "A4"), HasSubstr("none of letter, A4, A3, A2"));
  EXPECT_THAT(message("chessboard:9x6:20mm", "B4"), HasSubstr("paper 'B4'; need A4"));
  EXPECT_THAT(message("chess", "A4"), HasSubstr("need \"chessboard:9x6:24mm\""));
}

}  // namespace
}  // namespace sateen::page_test
