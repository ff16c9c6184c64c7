#include "scanner/sessions/lp_layout.h"

#include "tests/scanner/sessions/dataset_files.h"

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

Result<Dataset> ReadLp(const std::string& text) {
  const TempFolder temp;
  WriteThreeImages(temp.Path());
  WriteFlat(temp.Path() / "b 2  final.exr", 0.2F);
  WriteFlat(temp.Path() / "sub/a.exr", 0.1F);
  WriteText(temp.Path() / "dome.lp", text);
  return ReadDataset(temp.Path() / "dome.lp", {});
}

Error FailureOfLp(const std::string& text) {
  const Result<Dataset> dataset = ReadLp(text);
  EXPECT_FALSE(dataset) << text;
  return dataset ? Error{} : dataset.error();
}

TEST(Lp, ReadsTheLinesInTheirOrder) {
  const Result<Dataset> dataset = ReadLp(kThreeLines);
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(dataset->layout, "lp");
  ASSERT_THAT(dataset->stack, SizeIs(3));
  EXPECT_FLOAT_EQ(dataset->stack[1].rgb[0].At(0, 0), 0.2F);
  EXPECT_LT((dataset->rig.lights[1].direction - Eigen::Vector3d(-0.6, 0, 0.8)).norm(), 1e-15);
  EXPECT_EQ(dataset->rig.lights[1].flux_rgb, Eigen::Vector3d::Ones());
  EXPECT_THAT(dataset->warnings, IsEmpty());
}

TEST(Lp, AcceptsNamesWithBlanksAndPathsOfAnotherMachine) {
  const Result<Dataset> dataset = ReadLp(
      "\xEF\xBB\xBF"
      "3\r\n"
      "C:\\Users\\me\\RTI run\\a.exr\t0.6 0 0.8\r\n"
      "b 2  final.exr -0.6 0 0.8\r\n"
      "/home/me/c.exr 0 0.6 0.8\r\n\r\n");
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_THAT(dataset->stack[0].name, HasSubstr("/a.exr"));
  EXPECT_THAT(dataset->stack[1].name, HasSubstr("/b 2  final.exr"));
  EXPECT_THAT(dataset->stack[2].name, HasSubstr("/c.exr"));
}

TEST(Lp, PrefersThePathThatExists) {
  const Result<Dataset> dataset = ReadLp("1\nsub\\a.exr 0.6 0 0.8\n");
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_THAT(dataset->stack[0].name, HasSubstr("sub/a.exr"));
}

TEST(Lp, NormalisesPositionsAndSaysSoOnce) {
  const Result<Dataset> dataset = ReadLp("2\na.exr 300 0 400\nb.exr -30 0 40\n");
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_LT((dataset->rig.lights[0].direction - Eigen::Vector3d(0.6, 0, 0.8)).norm(), 1e-15);
  ASSERT_THAT(dataset->warnings, SizeIs(1));
  EXPECT_THAT(dataset->warnings[0], HasSubstr("2 of 2 lights are given by a position"));
}

TEST(Lp, TakesTheMaskBesideIt) {
  const TempFolder temp;
  WriteThreeImages(temp.Path());
  WriteText(temp.Path() / "dome.LP", kThreeLines);
  testing::WriteMask(temp.Path() / "mask.png");
  const Result<Dataset> dataset = ReadDataset(temp.Path() / "dome.LP", {});
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_TRUE(dataset->mask);
}

TEST(Lp, RefusesEachLineThatIsWrong) {
  EXPECT_THAT(FailureOfLp(""), IsError(ErrorCode::kBadData, "the file is empty"));
  EXPECT_THAT(FailureOfLp("0\n"), IsError(ErrorCode::kBadData, "the number of lights is 0"));
  EXPECT_THAT(FailureOfLp("a.exr 0.6 0 0.8\n"),
              IsError(ErrorCode::kBadData, "dome.lp:1: found 'a.exr'"));
  EXPECT_THAT(FailureOfLp("3 3\n"), IsError(ErrorCode::kBadData, "dome.lp:1: found 2 numbers"));
  EXPECT_THAT(FailureOfLp("3\na.exr 0.6 0 0.8\n"),
              IsError(ErrorCode::kBadData, "dome.lp:1: the number of lights is 3 but 1 follow"));
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
