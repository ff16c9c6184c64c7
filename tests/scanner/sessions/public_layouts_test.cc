#include "scanner/sessions/public_layouts.h"

#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::public_layouts_test {
namespace {

namespace fs = std::filesystem;

using testing::FailureOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsError;
using testing::Lines;
using testing::MustRead;
using ::testing::SizeIs;
using testing::TempFolder;
using testing::WriteFlat;
using testing::WriteText;

void ExpectFourFrames(const Dataset& dataset) {
  ASSERT_THAT(dataset.stack, SizeIs(4));
  ASSERT_THAT(dataset.rig.lights, SizeIs(4));
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_FLOAT_EQ(dataset.stack[k].rgb[1].At(2, 1), 0.1F * static_cast<float>(k + 1));
    EXPECT_EQ(dataset.rig.lights[k].model, LightModel::kDistant);
  }
  EXPECT_NEAR((dataset.rig.lights[3].direction - Eigen::Vector3d(0, -0.6, 0.8)).norm(), 0, 1e-15);
}

// The error of a folder whose lights.txt holds `text`.
Error FailureOfLights(const std::string& text) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  WriteText(temp.Path() / "lights.txt", text);
  return FailureOf(temp.Path());
}

TEST(Diligent, ReadsFramesByNameAndDividesByIntensities) {
  const TempFolder temp;
  testing::WriteDiligent(temp.Path());
  const Dataset dataset = MustRead(temp.Path());
  EXPECT_EQ(dataset.layout, "diligent");
  ExpectFourFrames(dataset);
  EXPECT_EQ(dataset.rig.lights[2].flux_rgb, Eigen::Vector3d(3, 6, 9));
  EXPECT_THAT(dataset.stack[0].name, HasSubstr("b.exr"));
}

TEST(Diligent, NamesTheCountsThatDiffer) {
  const TempFolder temp;
  testing::WriteDiligent(temp.Path());
  WriteText(temp.Path() / "filenames.txt", "b.exr\na.exr\nd.exr\n");
  EXPECT_THAT(FailureOf(temp.Path()),
              IsError(ErrorCode::kBadData,
                      "4 lines in light_directions.txt, 4 in light_intensities.txt and 3 in "
                      "filenames.txt"));
}

TEST(Diligent, NamesTheFileThatIsMissing) {
  for (const char* name : {"light_intensities.txt", "filenames.txt", "d.exr"}) {
    const TempFolder temp;
    testing::WriteDiligent(temp.Path());
    fs::remove(temp.Path() / name);
    EXPECT_THAT(FailureOf(temp.Path()), IsError(ErrorCode::kIo, name));
  }
}

TEST(Diligent, RefusesAnIntensityThatCannotBeDividedBy) {
  const TempFolder temp;
  testing::WriteDiligent(temp.Path());
  WriteText(temp.Path() / "light_intensities.txt", "1 2 3\n2 4 6\n3 0 9\n4 8 12\n");
  EXPECT_THAT(FailureOf(temp.Path()), IsError(ErrorCode::kBadData, "light_intensities.txt:3: "));
  WriteText(temp.Path() / "light_intensities.txt", "1 2 3\n2 4\n3 6 9\n4 8 12\n");
  EXPECT_THAT(FailureOf(temp.Path()),
              IsError(ErrorCode::kBadData, "light_intensities.txt:2: found 2 numbers"));
}

TEST(Diligent, RefusesAFileThatServesTwoLights) {
  const TempFolder temp;
  testing::WriteDiligent(temp.Path());
  WriteText(temp.Path() / "filenames.txt", "b.exr\na.exr\n./b.exr\nc.exr\n");
  EXPECT_THAT(FailureOf(temp.Path()), IsError(ErrorCode::kBadData, "is named for two lights"));
}

TEST(LightsFolder, ReadsImagesInNaturalOrder) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());  // im.8, im.9, im.10, im.11
  const Dataset dataset = MustRead(temp.Path());
  EXPECT_EQ(dataset.layout, "lights.txt");
  ExpectFourFrames(dataset);
  EXPECT_EQ(dataset.rig.lights[0].flux_rgb, Eigen::Vector3d::Ones());
  EXPECT_THAT(dataset.warnings, IsEmpty());
}

TEST(LightsFolder, ReadsLightsOneFolderUpHoweverThePathIsWritten) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path() / "cat");
  fs::rename(temp.Path() / "cat/lights.txt", temp.Path() / "lights.txt");
  for (const char* path : {"cat", "cat/", "cat/."}) {
    ExpectFourFrames(MustRead(temp.Path() / path));
  }
}

TEST(LightsFolder, AcceptsTheCountAlone) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  WriteText(temp.Path() / "lights.txt", "4\n" + Lines(testing::kDirections));
  ExpectFourFrames(MustRead(temp.Path()));
}

TEST(LightsFolder, AcceptsColumns) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  for (const char* count : {"", "4\n"}) {
    WriteText(temp.Path() / "lights.txt",
              std::string(count) + "0.6 -0.6 0 0\n0 0 0.6 -0.6\n0.8 0.8 0.8 0.8\n");
    ExpectFourFrames(MustRead(temp.Path()));
  }
}

TEST(LightsFolder, AcceptsIntensities) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  WriteText(temp.Path() / "lights.txt",
            "0.6 0 0.8 1 2 3\n-0.6 0 0.8 1 2 3\n0 0.6 0.8 1 2 3\n0 -0.6 0.8 4 5 6\n");
  const Dataset dataset = MustRead(temp.Path());
  ExpectFourFrames(dataset);
  EXPECT_EQ(dataset.rig.lights[3].flux_rgb, Eigen::Vector3d(4, 5, 6));
}

TEST(LightsFolder, NormalisesWhatIsRounded) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  WriteText(temp.Path() / "lights.txt", "0.604 0 0.805\n-.6 0 .8\n0 .6 .8\n0 -.6 .8\n");
  EXPECT_NEAR(MustRead(temp.Path()).rig.lights[0].direction.norm(), 1.0, 1e-15);
}

TEST(LightsFolder, RefusesDirectionsThatAreNone) {
  EXPECT_THAT(FailureOfLights("0.6 0 0.8\n0 0 0\n0 .6 .8\n0 -.6 .8\n"),
              IsError(ErrorCode::kBadData, "lights.txt:2: the direction [0, 0, 0] has length 0"));
  EXPECT_THAT(FailureOfLights("0.6 0 0.8\n-.6 0 .8\n0 .6 .8\n0 -.7 .8\n"),
              IsError(ErrorCode::kBadData, "lights.txt:4"));
}

TEST(LightsFolder, RefusesTablesOfAnotherShape) {
  EXPECT_THAT(FailureOfLights(""), IsError(ErrorCode::kBadData, "holds no lights"));
  EXPECT_THAT(FailureOfLights("5\n" + Lines(testing::kDirections)),
              IsError(ErrorCode::kBadData, "lights.txt:1: the number of lights is 5 but 4 follow"));
  EXPECT_THAT(FailureOfLights("1 2 3 4\n"),
              IsError(ErrorCode::kBadData, "lights.txt:1: found 4 numbers"));
  EXPECT_THAT(FailureOfLights(".6 0 .8\n-.6 0\n0 .6 .8\n0 -.6 .8\n"),
              IsError(ErrorCode::kBadData, "lights.txt:2: found 2 numbers"));
  EXPECT_THAT(FailureOfLights("0.6 -0.6 0 0\n0 0 0.6\n0.8 0.8 0.8 0.8\n"),
              IsError(ErrorCode::kBadData, "lights.txt:2: found 3 numbers"));
  EXPECT_THAT(FailureOfLights(".6 0 .8 1 1 1\n0 .6 .8\n"),
              IsError(ErrorCode::kBadData, "lights.txt:2: found 3 numbers; need 6"));
  EXPECT_THAT(FailureOfLights(".6 0 .8 1 0 1\n0 .6 .8 1 1 1\n"),
              IsError(ErrorCode::kBadData, "[1, 0, 1]"));
}

TEST(LightsFolder, NamesTheCountsThatDiffer) {
  EXPECT_THAT(FailureOfLights("0.6 0 0.8\n-0.6 0 0.8\n"),
              IsError(ErrorCode::kBadData, "4 images, im.8.exr to im.11.exr, but 2 lights"));
}

TEST(LightsFolder, LeavesOutTruthMasksAndHiddenFiles) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  WriteFlat(temp.Path() / ".im.0.exr", 0.9F);
  ASSERT_TRUE(WriteExr(temp.Path() / "normal_gt.exr", testing::LevelNormals()));
  testing::WriteMask(temp.Path() / "im.mask.png");
  testing::WriteMask(temp.Path() / "Normal_gt.png");
  const Dataset dataset = MustRead(temp.Path());
  ExpectFourFrames(dataset);
  EXPECT_TRUE(dataset.mask);
  EXPECT_TRUE(dataset.truth);
}

TEST(LightsFolder, WarnsOnceOfRawFilesLeftOut) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  WriteText(temp.Path() / "im.8.nef", "");
  WriteText(temp.Path() / "im.9.nef", "");
  const Dataset dataset = MustRead(temp.Path());
  ASSERT_THAT(dataset.warnings, SizeIs(1));
  EXPECT_THAT(dataset.warnings[0], HasSubstr("2 camera RAW files were left out"));
}

TEST(LightsFolder, SaysWhatIsThereInsteadOfPhotographs) {
  const TempFolder temp;
  WriteText(temp.Path() / "lights.txt", Lines(testing::kDirections));
  fs::create_directory(temp.Path() / "cat");
  EXPECT_THAT(FailureOf(temp.Path()),
              IsError(ErrorCode::kBadData, "found 1 file (1 .txt), 1 folder, no photograph"));
}

TEST(LightsFolder, TakesMaskAndTruthOneFolderUp) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path() / "specular");
  fs::rename(temp.Path() / "specular/lights.txt", temp.Path() / "lights.txt");
  testing::WriteMask(temp.Path() / "mask.png");
  ASSERT_TRUE(WriteExr(temp.Path() / "normal_gt.exr", testing::LevelNormals()));
  const Dataset dataset = MustRead(temp.Path() / "specular");
  EXPECT_TRUE(dataset.mask);
  ASSERT_TRUE(dataset.truth);
  EXPECT_THAT(dataset.truth->source, HasSubstr("normal_gt.exr"));
}

TEST(LightsFolder, LeavesOutASharedMaskThatDoesNotFit) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path() / "cat");
  testing::WriteMask(temp.Path() / "mask.png", {8, 8});
  const Dataset dataset = MustRead(temp.Path() / "cat");
  EXPECT_FALSE(dataset.mask);
  ASSERT_THAT(dataset.warnings, SizeIs(1));
  EXPECT_THAT(dataset.warnings[0], HasSubstr("the mask is not used"));
}

}  // namespace
}  // namespace sateen::public_layouts_test
