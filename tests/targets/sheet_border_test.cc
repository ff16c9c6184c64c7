#include "targets/sheet_border.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sateen::sheet_border_test {
namespace {

using ::testing::HasSubstr;

TEST(SheetBorder, ReadsWhatTextWrites) {
  for (const char* text : {"sheet:200x150mm:10mm:DICT_4X4_50", "sheet:A4:12.5mm:DICT_6X6_100"}) {
    EXPECT_EQ(ParseSheetBorder(text).value().Text(), text);
  }
  EXPECT_EQ(ParseSheetBorder("sheet:A4:12mm").value().dictionary, "DICT_4X4_100");
  EXPECT_EQ(ParseSheetBorder("sheet:letter:20mm").value().size_mm, Eigen::Vector2d(279.4, 215.9));
  EXPECT_EQ(ParseSheetBorder("sheet:150x200mm:10mm").value().size_mm, Eigen::Vector2d(150, 200));
}

// Clockwise from the top left, 5 mm from the edge, none over another, the inside free of them.
// Behind the last marker of a row there is no gap: without it 11 would fit along the short side.
TEST(SheetBorder, AsManyMarkersAsFitStandAlongASide) {
  const SheetBorder border = ParseSheetBorder("sheet:A4:12mm").value();
  EXPECT_EQ(border.MarkerCenters().size(), 2U * 17U + 2U * 10U);
}

TEST(SheetBorder, MarkersStandAlongTheRim) {
  const SheetBorder border = ParseSheetBorder("sheet:200x150mm:10mm").value();
  const std::vector<Eigen::Vector3d> at = border.MarkerCenters();
  ASSERT_EQ(at.size(), 2U * 13U + 2U * 8U);
  EXPECT_EQ(at[0], Eigen::Vector3d(-90, 65, 0));
  EXPECT_TRUE(at[12].isApprox(Eigen::Vector3d(90, 65, 0)));
  EXPECT_TRUE(at[21].isApprox(Eigen::Vector3d(90, -65, 0)));
  EXPECT_TRUE(at[33].isApprox(Eigen::Vector3d(-90, -65, 0)));
  EXPECT_TRUE(at[41].isApprox(Eigen::Vector3d(-90, 65 - 130.0 / 9.0, 0)));
  for (size_t i = 0; i < at.size(); ++i) {
    const Eigen::Vector2d half = Eigen::Vector2d::Constant(5.0);
    const Eigen::Vector2d center = at[i].head<2>();
    const Eigen::AlignedBox2d marker(center - half, center + half);
    EXPECT_GT(border.BlankMm().exteriorDistance(marker), 1.6) << i;
    for (size_t k = 0; k < i; ++k) {
      EXPECT_GE((at[i] - at[k]).head<2>().lpNorm<Eigen::Infinity>(), 14.0) << i << ' ' << k;
    }
  }
  EXPECT_NEAR(border.BlankMm().sizes().x(), 200.0 - 2.0 * (5.0 + 10.0 + 10.0 / 6.0), 1e-12);
}

TEST(SheetBorder, NamesWhatIsNeeded) {
  const auto message = [](const char* text) { return ParseSheetBorder(text).error().message; };
  for (const char* text :
       {"", "sheet", "sheet:A4", "sheet:A4:12", "sheets:A4:12mm", "sheet:A4:12mm:DICT_4X4_100:1"}) {
    EXPECT_THAT(message(text), HasSubstr("need \"sheet:A4:12mm\"")) << text;
  }
  EXPECT_THAT(message("sheet:A5:12mm"), HasSubstr("paper 'A5'; need A4, A3, A2, letter"));
  EXPECT_THAT(message("sheet:200x10mm:5mm"), HasSubstr("need 20 to 2000 mm"));
  EXPECT_THAT(message("sheet:A4:1mm"), HasSubstr("need 2 mm or more"));
  EXPECT_THAT(message("sheet:A4:nanmm"), HasSubstr("need 2 mm or more"));
  EXPECT_THAT(message("sheet:A4:60mm"), HasSubstr("less than a third"));
  EXPECT_THAT(message("sheet:100x100mm:24mm"), HasSubstr("fewer than 3 markers along a side"));
  EXPECT_THAT(message("sheet:A4:12mm:DICT_9"), HasSubstr("no dictionary 'DICT_9'"));
  EXPECT_THAT(message("sheet:A4:12mm:DICT_4X4_50"),
              HasSubstr("54 markers, and DICT_4X4_50 has 50"));
}

}  // namespace
}  // namespace sateen::sheet_border_test
