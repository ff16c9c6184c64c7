#include "scanner/devices/folder_camera.h"

#include <gmock/gmock.h>

#include "core/files/file_io.h"
#include "imaging/dng.h"
#include "tests/testing/files.h"

// Time passes by looks at the folder, and what happens at which look is the test's.
namespace sateen::folder_camera_test {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using testing::CutShort;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TempFolder;
using testing::WriteText;

constexpr milliseconds kDeadline(10000);

class FolderCameraTest : public ::testing::Test {
 protected:
  FolderCameraTest() {
    fs::create_directory(drop_);
    fs::create_directory(frames_);
  }

  void Drop(const std::string& name) {
    ASSERT_TRUE(WriteDng(drop_ / name, Image<uint16_t>(32, 32, 700),
                         {.exposure_s = 0.02, .f_number = 8.0, .iso = 100.0}));
  }
  FolderCameraOptions Options() {
    return {.folder = drop_,
            .quiet = milliseconds(200),
            .interval = milliseconds(100),
            .wait = [this](milliseconds) {
              if (const auto due = at_look_.find(++look_); due != at_look_.end()) {
                due->second();
              }
            }};
  }
  Result<CapturedFile> Capture() { return camera_.Capture(frames_, kDeadline); }

  const TempFolder folder_;
  const fs::path drop_ = folder_.Path() / "drop";
  const fs::path frames_ = folder_.Path() / "frames";
  std::map<int, std::function<void()>> at_look_;
  int look_ = 0;
  FolderCamera camera_{Options()};
};

TEST_F(FolderCameraTest, TakesWhatComesAndLeavesWhatWasThere) {
  Drop("old.dng");
  ASSERT_TRUE(camera_.Open());
  EXPECT_THAT(camera_.LeftAlone(), ElementsAre("old.dng"));
  at_look_[2] = [&] { Drop("a.dng"); };
  const Result<CapturedFile> a = Capture();
  ASSERT_TRUE(a) << a.error().message;
  EXPECT_EQ(a->name_on_camera, "a.dng");
  EXPECT_EQ(look_, 4);  // seen at the second look, and the same for two more
  EXPECT_EQ(ReadFileBytes(a->path).value(), ReadFileBytes(drop_ / "a.dng").value());
  at_look_[6] = [&] { Drop("b.dng"); };
  EXPECT_EQ(Capture()->name_on_camera, "b.dng");
}

TEST_F(FolderCameraTest, AFileCountsWhenItIsWhole) {
  ASSERT_TRUE(camera_.Open());
  std::string bytes;
  at_look_[1] = [&] {
    Drop("a.dng");
    bytes = ReadFileBytes(drop_ / "a.dng").value();
    CutShort(drop_ / "a.dng", 600);
  };
  at_look_[2] = [&] { CutShort(drop_ / "a.dng", 700); };  // grows
  at_look_[9] = [&] { WriteText(drop_ / "a.dng", bytes); };
  const Result<CapturedFile> frame = Capture();
  ASSERT_TRUE(frame) << frame.error().message;
  EXPECT_EQ(look_, 11);
  EXPECT_EQ(frame->bytes, bytes.size());
}

TEST_F(FolderCameraTest, AFileThatStaysBrokenIsBadDataAndLeavesNothing) {
  ASSERT_TRUE(camera_.Open());
  at_look_[1] = [&] {
    Drop("a.dng");
    CutShort(drop_ / "a.dng", 600);
  };
  const Result<CapturedFile> frame = Capture();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().code, ErrorCode::kBadData);
  EXPECT_THAT(frame.error().message, HasSubstr("a.dng does not decode"));
  EXPECT_TRUE(fs::is_empty(frames_));
}

TEST_F(FolderCameraTest, WhatCameBetweenTwoFramesIsLeftAloneAndNamed) {
  ASSERT_TRUE(camera_.Open());
  Drop("early.dng");
  at_look_[1] = [&] { WriteText(drop_ / "beside.jpg", "no RAW"); };
  const Result<CapturedFile> frame = Capture();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().code, ErrorCode::kTimeout);
  EXPECT_THAT(frame.error().message, HasSubstr("left alone: early.dng;"));
}

TEST_F(FolderCameraTest, TwoFilesForOneFrameAreRefused) {
  ASSERT_TRUE(camera_.Open());
  at_look_[1] = [&] { Drop("a.dng"); };
  at_look_[2] = [&] { Drop("b.dng"); };
  const Result<CapturedFile> frame = Capture();
  ASSERT_FALSE(frame);
  EXPECT_THAT(frame.error().message, HasSubstr("a.dng and b.dng arrived for one frame"));
}

TEST_F(FolderCameraTest, AnotherExposureThanSetIsRefused) {
  ASSERT_TRUE(camera_.Open());
  for (const ExposureSettings& other :
       {ExposureSettings{.exposure_s = 0.025}, ExposureSettings{.f_number = 9.0},
        ExposureSettings{.iso = 125.0}}) {
    ASSERT_TRUE(camera_.Configure(other));
    at_look_ = {{look_ + 1, [&] { Drop(std::to_string(look_) + ".dng"); }}};
    const Result<CapturedFile> frame = Capture();
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error().code, ErrorCode::kDevice) << frame.error().message;
    EXPECT_THAT(frame.error().message, HasSubstr("was set"));
  }
  EXPECT_TRUE(fs::is_empty(frames_));
}

TEST_F(FolderCameraTest, NamesThatAreTakenAreNotOverwritten) {
  ASSERT_TRUE(camera_.Open());
  WriteText(frames_ / "a.dng", "mine");
  at_look_[1] = [&] { Drop("a.dng"); };
  EXPECT_EQ(Capture()->path, frames_ / "a-2.dng");
  EXPECT_EQ(ReadFileBytes(frames_ / "a.dng").value(), "mine");
}

TEST_F(FolderCameraTest, AFolderThatIsNotThereIsADeviceError) {
  FolderCamera camera({.folder = drop_ / "nowhere"});
  EXPECT_EQ(camera.Open().error().code, ErrorCode::kDevice);
  EXPECT_EQ(camera.Capture(frames_, kDeadline).error().code, ErrorCode::kDevice);
}

}  // namespace
}  // namespace sateen::folder_camera_test
