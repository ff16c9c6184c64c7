#include "scanner/sessions/lp_layout.h"

#include "tests/scanner/sessions/captures.h"

namespace sateen::lp_layout_test {
namespace {

namespace fs = std::filesystem;

using testing::FailureOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsError;
using ::testing::SizeIs;
using testing::TempFolder;
using testing::WriteFlat;
using testing::WriteText;

constexpr const char* kThreeLines = "3\na.exr 0.6 0 0.8\nb.exr -0.6 0 0.8\nc.exr 0 0.6 0.8\n";

void WriteThreeImages(const fs::path& dir) {
  WriteFlat(dir / "a.exr", 0.1F);
  WriteFlat(dir / "b.exr", 0.2F);
  WriteFlat(dir / "c.exr", 0.3F);
}

Result<Capture> ReadLp(const std::string& text) {
  const TempFolder temp;
  WriteThreeImages(temp.Path());
  WriteFlat(temp.Path() / "b 2  final.exr", 0.2F);
  WriteFlat(temp.Path() / "sub/a.exr", 0.1F);
  WriteText(temp.Path() / "dome.lp", text);
  return ReadCapture(temp.Path() / "dome.lp", {});
}

Error FailureOfLp(const std::string& text) {
  const Result<Capture> capture = ReadLp(text);
  EXPECT_FALSE(capture) << text;
  return capture ? Error{} : capture.error();
}

TEST(Lp, ReadsTheLinesInTheirOrder) {
  const Result<Capture> capture = ReadLp(kThreeLines);
  ASSERT_TRUE(capture) << capture.error().message;
  EXPECT_EQ(capture->layout, "lp");
  ASSERT_THAT(capture->stack, SizeIs(3));
  EXPECT_FLOAT_EQ(capture->stack[1].rgb[0].At(0, 0), 0.2F);
  EXPECT_LT((capture->rig.lights[1].direction - Eigen::Vector3d(-0.6, 0, 0.8)).norm(), 1e-15);
  EXPECT_EQ(capture->rig.lights[1].flux_rgb, Eigen::Vector3d::Ones());
  EXPECT_THAT(capture->warnings, IsEmpty());
}

TEST(Lp, AcceptsNamesWithBlanksAndPathsOfAnotherMachine) {
  const Result<Capture> capture = ReadLp(
      "\xEF\xBB\xBF"
      "3\r\n"
      "C:\\Users\\me\\RTI run\\a.exr\t0.6 0 0.8\r\n"
      "b 2  final.exr -0.6 0 0.8\r\n"
      "/home/me/c.exr 0 0.6 0.8\r\n\r\n");
  ASSERT_TRUE(capture) << capture.error().message;
  EXPECT_THAT(capture->stack[0].name, HasSubstr("/a.exr"));
  EXPECT_THAT(capture->stack[1].name, HasSubstr("/b 2  final.exr"));
  EXPECT_THAT(capture->stack[2].name, HasSubstr("/c.exr"));
}

TEST(Lp, PrefersThePathThatExists) {
  const Result<Capture> capture = ReadLp("1\nsub\\a.exr 0.6 0 0.8\n");
  ASSERT_TRUE(capture) << capture.error().message;
  EXPECT_THAT(capture->stack[0].name, HasSubstr("sub/a.exr"));
}

TEST(Lp, NormalisesPositionsAndSaysSoOnce) {
  const Result<Capture> capture = ReadLp("2\na.exr 300 0 400\nb.exr -30 0 40\n");
  ASSERT_TRUE(capture) << capture.error().message;
  EXPECT_LT((capture->rig.lights[0].direction - Eigen::Vector3d(0.6, 0, 0.8)).norm(), 1e-15);
  ASSERT_THAT(capture->warnings, SizeIs(1));
  EXPECT_THAT(capture->warnings[0], HasSubstr("2 of 2 lights are given by a position"));
}

TEST(Lp, TakesTheMaskBesideIt) {
  const TempFolder temp;
  WriteThreeImages(temp.Path());
  WriteText(temp.Path() / "dome.LP", kThreeLines);
  testing::WriteMask(temp.Path() / "mask.png");
  const Result<Capture> capture = ReadCapture(temp.Path() / "dome.LP", {});
  ASSERT_TRUE(capture) << capture.error().message;
  EXPECT_TRUE(capture->mask);
}

TEST(Lp, RefusesEachLineThatIsWrong) {
  EXPECT_THAT(FailureOfLp(""), IsError(ErrorCode::kBadData, "the file is empty"));
  EXPECT_THAT(FailureOfLp("0\n"), IsError(ErrorCode::kBadData, "the count is 0"));
  EXPECT_THAT(FailureOfLp("a.exr 0.6 0 0.8\n"),
              IsError(ErrorCode::kBadData, "dome.lp:1: found 'a.exr'"));
  EXPECT_THAT(FailureOfLp("3 3\n"), IsError(ErrorCode::kBadData, "dome.lp:1: found 2 numbers"));
  EXPECT_THAT(FailureOfLp("3\na.exr 0.6 0 0.8\n"),
              IsError(ErrorCode::kBadData, "dome.lp:1: the count is 3 but 1 lights follow"));
  EXPECT_THAT(FailureOfLp("1\na.exr 0.6 0.8\n"),
              IsError(ErrorCode::kBadData, "dome.lp:2: found 3 words"));
  EXPECT_THAT(FailureOfLp("1\na.exr 0.6 O 0.8\n"),
              IsError(ErrorCode::kBadData, "dome.lp:2: found 'O'"));
  EXPECT_THAT(FailureOfLp("1\na.exr 0 0 0\n"),
              IsError(ErrorCode::kBadData, "dome.lp:2: the direction [0, 0, 0] has length 0"));
  EXPECT_THAT(FailureOfLp("1\nD:\\x\\gone.exr 0.6 0 0.8\n"),
              IsError(ErrorCode::kBadData, "dome.lp:2: found neither the image D:\\x\\gone.exr"));
}

TEST(Lp, RefusesTwoPathsThatEndAtOneFile) {
  EXPECT_THAT(FailureOfLp("2\nC:\\1\\a.exr 0.6 0 0.8\nC:\\2\\a.exr -0.6 0 0.8\n"),
              IsError(ErrorCode::kBadData, "is named for two lights"));
}

}  // namespace
}  // namespace sateen::lp_layout_test
