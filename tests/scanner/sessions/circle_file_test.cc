#include "scanner/sessions/files/circle_file.h"

#include <gmock/gmock.h>

#include "tests/testing/files.h"

namespace sateen::circle_file_test {
namespace {

Result<std::vector<Circle>> Read(const std::string& text) {
  const testing::TempFolder folder;
  testing::WriteText(folder.Path() / "circles.txt", text);
  std::map<std::string, std::string> hashes;
  return ReadCircles(folder.Path() / "circles.txt", {640, 480}, hashes);
}

TEST(CircleFile, ALineIsOneSphereInPixels) {
  const auto circles = Read("320.5 240.25 100\n10 20 30\n");

  ASSERT_TRUE(circles) << circles.error().message;
  ASSERT_EQ(circles->size(), 2U);
  EXPECT_EQ((*circles)[0].center_px, Eigen::Vector2d(320.5, 240.25));
  EXPECT_EQ((*circles)[0].radius_px, 100.0);
  EXPECT_EQ((*circles)[1].center_px, Eigen::Vector2d(10.0, 20.0));
}

// Pixels counted from 1, rows from below: of 480 rows the lowest is row 479 of ours.
TEST(CircleFile, ThreeLinesASphereCountFromOneAndFromBelow) {
  const auto circles = Read("321\n1\n100\n");

  ASSERT_TRUE(circles) << circles.error().message;
  ASSERT_EQ(circles->size(), 1U);
  EXPECT_EQ((*circles)[0].center_px, Eigen::Vector2d(320.0, 479.0));
  EXPECT_EQ((*circles)[0].radius_px, 100.0);
}

TEST(CircleFile, RefusesWhatIsNoCircle) {
  for (const char* wrong : {"", "1 2\n", "1 2 0\n", "1 2 -3\n", "1\n2\n3\n4\n", "1e308 80 55\n",
                            "640 240 30\n", "-1 240 30\n", "320 480 30\n", "320 240 641\n"}) {
    const auto circles = Read(wrong);
    ASSERT_FALSE(circles) << wrong;
    EXPECT_EQ(circles.error().code, ErrorCode::kBadData);
  }
}

}  // namespace
}  // namespace sateen::circle_file_test
