#include "scanner/sessions/dataset.h"

#include <atomic>

#include "core/sha256.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::dataset_test {
namespace {

namespace fs = std::filesystem;

using ::testing::ElementsAre;
using testing::FailureOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsError;
using ::testing::SizeIs;
using testing::TempFolder;
using testing::WriteFlat;
using testing::WriteText;

// A folder with lights.txt, mask and truth, which most tests spoil in one way.
class StackReader : public ::testing::Test {
 protected:
  StackReader() {
    testing::WriteLightsFolder(dir_);
    testing::WriteMask(dir_ / "mask.png");
    EXPECT_TRUE(WriteExr(dir_ / "normal_gt.exr", testing::LevelNormals()));
  }
  Dataset MustRead(const ReadDatasetOptions& options = {}, const Task& task = {}) {
    return testing::MustRead(dir_, options, task);
  }

  TempFolder temp_;
  fs::path dir_ = temp_.Path() / "cat";
};

TEST_F(StackReader, HashesEveryFileThatItReads) {
  const Dataset dataset = MustRead();
  std::vector<std::string> names;
  for (const auto& [path, hash] : dataset.sha256_of_input) {
    names.push_back(fs::path(path).filename().string());
    EXPECT_EQ(hash, Sha256OfFile(path).value()) << path;
  }
  EXPECT_THAT(names, ElementsAre("im.10.exr", "im.11.exr", "im.8.exr", "im.9.exr", "lights.txt",
                                 "mask.png", "normal_gt.exr"));
}

TEST_F(StackReader, TakesTheLightsAskedForInTheOrderAsked) {
  const Dataset dataset = MustRead({.lights = {3, 1}});
  ASSERT_THAT(dataset.stack, SizeIs(2));
  EXPECT_FLOAT_EQ(dataset.stack[0].rgb[0].At(0, 0), 0.4F);
  EXPECT_FLOAT_EQ(dataset.stack[1].rgb[0].At(0, 0), 0.2F);
  ASSERT_THAT(dataset.rig.lights, SizeIs(2));
  EXPECT_EQ(dataset.rig.lights[0].name, "light-3");
}

TEST_F(StackReader, DoesNotReadFramesOfOtherLights) {
  WriteText(dir_ / "im.8.exr", "not an image");
  EXPECT_THAT(MustRead({.lights = {1, 2}}).stack, SizeIs(2));
}

TEST_F(StackReader, RefusesLightsThatDoNotExistOrTwice) {
  EXPECT_THAT(FailureOf(dir_, {.lights = {0, 4}}),
              IsError(ErrorCode::kInvalidArgument, "light 4 does not exist; there are 0 to 3"));
  EXPECT_THAT(FailureOf(dir_, {.lights = {-1}}),
              IsError(ErrorCode::kInvalidArgument, "light -1 does not exist"));
  EXPECT_THAT(FailureOf(dir_, {.lights = {2, 2}}),
              IsError(ErrorCode::kInvalidArgument, "light 2 is named twice"));
}

TEST_F(StackReader, NamesTheFrameOfAnotherSize) {
  WriteFlat(dir_ / "im.10.exr", 0.1F, {4, 5});
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData,
                                       "im.10.exr: is 4 x 5 px, but the first frame is 4 x 3 px"));
}

// Decoding 900 megapixels would take seconds and end with the words for a damaged file.
TEST_F(StackReader, ComparesSizesBeforePixelsAreDecoded) {
  std::string bytes("\0\0\x0A\0\0\0\0\0\0\0\0\0\x30\x75\x30\x75\x18\0", 18);  // a TGA
  bytes.resize(1'000'000);
  const fs::path bomb = dir_ / "im.10.tga";
  fs::remove(dir_ / "im.10.exr");
  testing::WriteText(bomb, bytes);
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "im.10.tga: is 30000 x 30000 px"));
  fs::rename(bomb, dir_ / "im.1.tga");  // it is the first now
  EXPECT_THAT(FailureOf(dir_),
              IsError(ErrorCode::kBadData, "im.1.tga: its header says 30000 x 30000 pixels"));
}

TEST_F(StackReader, ReadsAFirstFrameOfAsManyPixelsAsAreAllowed) {
  ReadDatasetOptions options{.max_pixels = 11};
  EXPECT_FALSE(ReadDataset(dir_, options));  // the frames have 12
  options.max_pixels = 12;
  EXPECT_TRUE(ReadDataset(dir_, options));
}

TEST_F(StackReader, NamesTheFirstFrameThatIsNoImage) {
  WriteText(dir_ / "im.11.exr", "not an image");
  WriteText(dir_ / "im.9.exr", "not an image");
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "im.9.exr"));
}

TEST_F(StackReader, RefusesAMaskThatDoesNotFitOrIsEmpty) {
  testing::WriteMask(dir_ / "mask.png", {5, 3});
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "mask.png: is 5 x 3 px"));
  testing::WriteMask(dir_ / "mask.png", testing::kSize, 127);
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "mask.png: the mask is empty"));
}

TEST_F(StackReader, TakesTheMaskThatTheCallerNames) {
  testing::WriteMask(dir_ / "mask.png", {5, 3});  // not even looked at then
  testing::WriteMask(temp_.Path() / "other.png");
  const Dataset dataset = MustRead({.mask_file = temp_.Path() / "other.png"});
  ASSERT_TRUE(dataset.mask);
  EXPECT_NE(dataset.mask->At(0, 0), 0);
  EXPECT_EQ(dataset.mask->At(1, 0), 0);
  EXPECT_THAT(FailureOf(dir_, {.mask_file = temp_.Path() / "gone.png"}),
              IsError(ErrorCode::kIo, "gone.png"));
}

TEST_F(StackReader, TakesTheRigThatTheCallerNames) {
  Rig rig = testing::FourLights();
  WriteText(temp_.Path() / "rig.json", RigToJson(rig));
  const Dataset dataset = MustRead({.lights = {2}, .rig_file = temp_.Path() / "rig.json"});
  ASSERT_THAT(dataset.rig.lights, SizeIs(1));
  EXPECT_EQ(dataset.rig.lights[0].name, "north");
  EXPECT_TRUE(dataset.sha256_of_input.contains((temp_.Path() / "rig.json").string()));

  rig.lights.pop_back();
  WriteText(temp_.Path() / "rig.json", RigToJson(rig));
  EXPECT_THAT(FailureOf(dir_, {.rig_file = temp_.Path() / "rig.json"}),
              IsError(ErrorCode::kBadData, "has 3 lights but there are 4 frames"));
}

TEST_F(StackReader, RefusesTruthThatDoesNotFit) {
  ASSERT_TRUE(WriteExr(dir_ / "normal_gt.exr", testing::LevelNormals({3, 3})));
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "normal_gt.exr: is 3 x 3 px"));
}

TEST_F(StackReader, WarnsOnceOfFramesThatWereSrgb) {
  for (int k = 8; k < 12; ++k) {
    fs::remove(dir_ / fmt::format("im.{}.exr", k));
    const Image<uint8_t> plane(testing::kSize, 128);
    ASSERT_TRUE(WritePng8(dir_ / fmt::format("im.{}.png", k), {plane, plane, plane}));
  }
  const Dataset srgb = MustRead();
  ASSERT_THAT(srgb.warnings, SizeIs(1));
  EXPECT_THAT(srgb.warnings[0], HasSubstr("4 of 4 frames are sRGB files and were linearised"));
  EXPECT_NEAR(srgb.stack[0].rgb[0].At(0, 0), 0.21586F, 1e-5F);  // from 128 / 255, IEC 61966-2-1

  const Dataset linear = MustRead({.encoding = Encoding::kLinear});
  EXPECT_THAT(linear.warnings, IsEmpty());
  EXPECT_FLOAT_EQ(linear.stack[0].rgb[0].At(0, 0), 128.0F / 255.0F);
}

TEST_F(StackReader, IntegerFilesSaturateAndFloatFilesDoNot) {
  fs::remove(dir_ / "im.8.exr");
  testing::WriteFlatPng16(dir_ / "im.8.png", 6554);
  const Dataset dataset = MustRead();
  EXPECT_FLOAT_EQ(dataset.stack[0].full_scale, 1.0F);
  EXPECT_TRUE(std::isinf(dataset.stack[1].full_scale));
}

TEST_F(StackReader, GivesTheSameBitsOnAnyNumberOfThreads) {
  const Dataset one = MustRead({}, {.threads = 1});
  const Dataset five = MustRead({}, {.threads = 5});
  ASSERT_EQ(one.stack.size(), five.stack.size());
  for (size_t k = 0; k < one.stack.size(); ++k) {
    EXPECT_EQ(one.stack[k].name, five.stack[k].name);
    EXPECT_EQ(one.stack[k].rgb[0].pixels, five.stack[k].rgb[0].pixels);
  }
  EXPECT_EQ(one.sha256_of_input, five.sha256_of_input);
}

class CountingProgress : public Progress {
 public:
  void BeginStage(std::string_view name, int total) override {
    stage = name;
    left = total;
  }
  void Clear() override {}
  void Advance(int steps) override { left -= steps; }

  std::string stage;
  std::atomic<int> left = -1;
};

TEST_F(StackReader, TellsItsProgressToTheEnd) {
  testing::WriteSession(temp_.Path() / "session", testing::FourLightSession());
  for (const char* name : {"cat", "session"}) {
    CountingProgress progress;
    ASSERT_TRUE(ReadDataset(temp_.Path() / name, {}, {.progress = &progress}));
    EXPECT_EQ(progress.stage, "reading");
    EXPECT_EQ(progress.left, 0);
  }
}

TEST_F(StackReader, StopsWhenCancelled) {
  const std::atomic<bool> cancel = true;
  const Result<Dataset> dataset = ReadDataset(dir_, {}, {.cancel = &cancel});
  ASSERT_FALSE(dataset);
  EXPECT_EQ(dataset.error().code, ErrorCode::kCancelled);
}

TEST_F(StackReader, SaysWhatItFoundWhereThereIsNoCapture) {
  EXPECT_THAT(FailureOf(temp_.Path() / "gone"),
              IsError(ErrorCode::kIo, "gone: No such file or directory; need a folder"));
  EXPECT_THAT(FailureOf(temp_.Path() / "gone.lp"), IsError(ErrorCode::kIo, "gone.lp"));
  EXPECT_THAT(FailureOf(dir_ / "im.8.exr"),
              IsError(ErrorCode::kBadData, "is neither a folder nor an .lp file"));
  EXPECT_THAT(FailureOf(temp_.Path()),
              IsError(ErrorCode::kBadData, "found 0 files, 1 folder, and no session.json"));
  fs::remove(dir_ / "lights.txt");
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData,
                                       "found 6 files (5 .exr, 1 .png), and no session.json, "
                                       "light_directions.txt or lights.txt"));
}

TEST_F(StackReader, ASessionCountsBeforeOtherLayouts) {
  testing::WriteSession(dir_, testing::FourLightSession());
  EXPECT_EQ(MustRead().layout, "session");
}

}  // namespace
}  // namespace sateen::dataset_test
