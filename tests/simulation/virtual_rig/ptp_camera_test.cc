#include "scanner/devices/ptp_camera.h"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <cstdlib>

#include "core/files/file_io.h"
#include "imaging/dng.h"
#include "imaging/raw.h"
#include "simulation/virtual_rig/camera/ptp_responder.h"
#include "tests/scanner/sessions/dataset_files.h"
#include "tests/testing/files.h"

// PtpCamera with libgphoto2 as it is, and a camera on the loopback interface. Deadlines are long
// where the camera answers and short only where it never will; nothing depends on how fast the
// machine is.
namespace sateen::testing::ptp_camera_test {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using State = PtpCamera::State;

constexpr seconds kLong(30);
constexpr milliseconds kShort(500);

// Every site of a frame reads its number.
Result<std::string> NumberedFrame(const fs::path& folder, const FrameRequest& request) {
  Image<uint16_t> mosaic(64, 48);
  for (uint16_t& site : mosaic.pixels) {
    site = static_cast<uint16_t>(1000 * request.number);
  }
  const fs::path path = folder / "frame.dng";
  const Status written = WriteDng(
      path, mosaic,
      {.exposure_s = request.exposure_s, .f_number = request.f_number, .iso = request.iso});
  return written ? ReadFileBytes(path) : tl::unexpected(written.error());
}

int NumberIn(const fs::path& path) {
  const Result<RawMosaic> mosaic = ReadRawMosaic(path);
  EXPECT_TRUE(mosaic) << mosaic.error().message;
  return mosaic ? static_cast<int>(std::lround(mosaic->samples.pixels[5] * 65.535F)) : 0;
}

class PtpCameraTest : public ::testing::TestWithParam<const char*> {
 protected:
  PtpCameraTest() {
    setenv("HOME", home_.Path().c_str(), 1);  // libgphoto2 keeps settings there
    fs::create_directory(folder_);
    auto started = PtpResponder::Start(
        {.persona = Persona(),
         .source = [this](const FrameRequest& r) { return NumberedFrame(home_.Path(), r); },
         .late = milliseconds(1200)});
    EXPECT_TRUE(started) << started.error().message;
    responder_ = *std::move(started);
    options_.port = responder_->PortName();
    options_.answer_timeout = kLong;
  }

  [[nodiscard]] const char* Persona() const {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    return info->value_param() != nullptr ? GetParam() : "generic";
  }
  VirtualCamera& Virtual() { return responder_->Camera(); }

  // A camera that is open, and set to the settings that it has anyway.
  std::unique_ptr<PtpCamera> Opened() {
    auto camera = std::make_unique<PtpCamera>(options_);
    const Result<CameraInfo> info = camera->Open();
    EXPECT_TRUE(info) << info.error().message;
    const Result<ExposureSettings> set = camera->Configure({.exposure_s = 0.02});
    EXPECT_TRUE(set) << set.error().message;
    return camera;
  }

  // The next capture fails with the code, names the camera and what `words` say, leaves no file in
  // the folder, and after Open() the next frame is its own.
  void ExpectFailure(PtpCamera& camera, ErrorCode code, const std::string& words,
                     milliseconds deadline = kLong) {
    const Result<CapturedFile> failed = camera.Capture(folder_, deadline);
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().code, code) << failed.error().message;
    EXPECT_THAT(failed.error().message, HasSubstr(words));
    EXPECT_THAT(failed.error().message, HasSubstr(responder_->PortName()));
    EXPECT_TRUE(fs::is_empty(folder_));
  }
  void ExpectNextFrameIsItsOwn(PtpCamera& camera) {
    if (camera.state() != State::kOpen) {
      const Result<CameraInfo> opened = camera.Open();
      ASSERT_TRUE(opened) << opened.error().message;
      ASSERT_TRUE(camera.Configure({.exposure_s = 0.02}));
    }
    const Result<CapturedFile> frame = camera.Capture(folder_, kLong);
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_EQ(NumberIn(frame->path), Virtual().Report().captures);
  }

  const TempFolder home_;
  const fs::path folder_ = home_.Path() / "frames";
  std::unique_ptr<PtpResponder> responder_;
  PtpCameraOptions options_;
};

TEST_P(PtpCameraTest, FramesComeWholeInOrderAndLeaveTheCardEmpty) {
  PtpCamera camera(options_);
  const Result<CameraInfo> info = camera.Open();
  ASSERT_TRUE(info) << info.error().message;
  EXPECT_EQ(info->profile, Persona());
  EXPECT_EQ(info->model, std::string(Persona()) == "nikon" ? "D5100" : "Virtual Camera");
  const ExposureSettings wanted = {.exposure_s = 0.1, .f_number = 5.6, .iso = 400};
  const Result<ExposureSettings> set = camera.Configure(wanted);
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_NEAR(set->exposure_s, 0.1, 1e-6);
  EXPECT_NEAR(set->f_number, 5.6, 1e-6);
  EXPECT_NEAR(set->iso, 400.0, 1e-6);
  for (int k = 1; k <= 3; ++k) {
    const Result<CapturedFile> frame = camera.Capture(folder_, kLong);
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_EQ(NumberIn(frame->path), k);
    EXPECT_EQ(frame->bytes, fs::file_size(frame->path));
    EXPECT_EQ(ReadRawMosaic(frame->path)->exposure_s.value(), 0.1F);
  }
  EXPECT_EQ(Virtual().Report().on_card, 0);
  EXPECT_EQ(Virtual().Report().deleted, 3);
  EXPECT_EQ(Virtual().Report().sessions, 1);
}

INSTANTIATE_TEST_SUITE_P(Personas, PtpCameraTest, ::testing::Values("generic", "nikon"));

using PtpCameraFaults = PtpCameraTest;

TEST_F(PtpCameraFaults, AValueBetweenTwoNamesBoth) {
  const auto camera = Opened();
  const auto refused = camera->Configure({.exposure_s = 0.07});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(refused.error().message, HasSubstr("0.05 and 0.1"));
  EXPECT_EQ(camera->ExposureTimes().front(), 1e-4);
  EXPECT_EQ(camera->ExposureTimes().back(), 30.0);
}

TEST_F(PtpCameraFaults, AutomaticExposureAndFocusAreRefused) {
  Virtual().SetProperty(0x500E, 2);
  const auto program = PtpCamera(options_).Open();
  ASSERT_FALSE(program);
  EXPECT_THAT(program.error().message, HasSubstr("need manual exposure: turn the mode dial to M"));
  Virtual().SetProperty(0x500E, 1);
  Virtual().SetProperty(0x500A, 2);
  const auto focus = PtpCamera(options_).Open();
  ASSERT_FALSE(focus);
  EXPECT_EQ(focus.error().code, ErrorCode::kDevice);
  EXPECT_THAT(focus.error().message, HasSubstr("need manual focus"));
}

TEST_F(PtpCameraFaults, BusyForAWhileIsWaitedFor) {
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kBusy, 3);
  ExpectNextFrameIsItsOwn(*camera);
}

TEST_P(PtpCameraTest, AFullCardNeedsAPerson) {
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kCardFull);
  ExpectFailure(*camera, ErrorCode::kDevice,
                ": the camera's memory card is full; delete files or change the card");
  EXPECT_TRUE(camera->NeedsAPerson());
  ExpectNextFrameIsItsOwn(*camera);
  EXPECT_FALSE(camera->NeedsAPerson());
}

// The camera is not blamed for a refusal of the disk, and goes on.
TEST_P(PtpCameraTest, ADiskThatTakesNoFileIsSaidWithItsPath) {
  const auto camera = Opened();
  const fs::path gone = home_.Path() / "gone";
  const Result<CapturedFile> failed = camera->Capture(gone, kLong);
  ASSERT_FALSE(failed);
  EXPECT_THAT(failed.error(), IsError(ErrorCode::kIo, (gone / ".").string()));
  EXPECT_THAT(failed.error().message, HasSubstr("cannot write: No such file or directory"));
  EXPECT_EQ(camera->state(), State::kOpen);
  EXPECT_FALSE(camera->NeedsAPerson());
  EXPECT_EQ(Virtual().Report().on_card, 1);  // it is not lost
  ExpectNextFrameIsItsOwn(*camera);
}

// As on a disk that becomes full in the middle of a file: the worker inherits a limit of its size.
TEST_P(PtpCameraTest, AFileThatFindsNoRoomLeavesNothing) {
  rlimit before = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit small = before;
  small.rlim_cur = 1024;
  std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  const auto camera = Opened();
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, SIG_DFL);
  const Result<CapturedFile> failed = camera->Capture(folder_, kLong);
  ASSERT_FALSE(failed);
  EXPECT_THAT(failed.error(), IsError(ErrorCode::kIo, "File too large"));
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(PtpCameraFaults, AFileThatIsNeverAnnouncedEndsAtTheDeadline) {
  options_.settle = milliseconds(0);
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kNoEvent);
  ExpectFailure(*camera, ErrorCode::kTimeout, "no file arrived in time", kShort);
  EXPECT_EQ(camera->state(), State::kLost);
  ExpectNextFrameIsItsOwn(*camera);
}

TEST_F(PtpCameraFaults, ALateFileIsNotTakenForTheNextFrame) {
  options_.settle = seconds(2);  // the file comes after 1.2 s
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kLateEvent);
  ExpectFailure(*camera, ErrorCode::kTimeout, "no file arrived in time", kShort);
  ExpectNextFrameIsItsOwn(*camera);
}

TEST_F(PtpCameraFaults, ALateFileInTheNextExposureIsNotTakenForIt) {
  options_.settle = milliseconds(0);
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kLateEvent);
  ExpectFailure(*camera, ErrorCode::kTimeout, "no file arrived in time", kShort);
  ASSERT_TRUE(camera->Open());
  ASSERT_TRUE(camera->Configure({.exposure_s = 2.0}));
  const Result<CapturedFile> frame = camera->Capture(folder_, kLong);
  ASSERT_TRUE(frame) << frame.error().message;
  EXPECT_EQ(NumberIn(frame->path), 2);
}

TEST_F(PtpCameraFaults, AConnectionThatBreaksIsLostAndComesBack) {
  const auto camera = Opened();
  for (const CameraFault fault : {CameraFault::kGone, CameraFault::kDroppedMidFile}) {
    Virtual().Inject(fault);
    ExpectFailure(*camera, ErrorCode::kDevice, "camera at ");
    EXPECT_EQ(camera->state(), State::kLost);
    EXPECT_FALSE(camera->Capture(folder_, kLong));
    ExpectNextFrameIsItsOwn(*camera);
    fs::remove_all(folder_);
    fs::create_directory(folder_);
  }
}

TEST_F(PtpCameraFaults, AShortDownloadIsTriedAgain) {
  options_.decode = false;  // by its size alone
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kShortTransfer);
  ExpectNextFrameIsItsOwn(*camera);
}

TEST_F(PtpCameraFaults, ATruncatedFileDoesNotCount) {
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kTruncatedFile);
  ExpectFailure(*camera, ErrorCode::kBadData, "does not decode");
  EXPECT_EQ(Virtual().Report().deleted, 0);
  ExpectNextFrameIsItsOwn(*camera);
}

TEST_F(PtpCameraFaults, AnotherExposureThanSetIsRefused) {
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kWrongExposure);
  ExpectFailure(*camera, ErrorCode::kDevice, "exposed with time [s] 0.08, and 0.02 was set");
  ExpectNextFrameIsItsOwn(*camera);
}

TEST_F(PtpCameraFaults, TwoFilesForOneFrameAreRefused) {
  const auto camera = Opened();
  Virtual().Inject(CameraFault::kTwoFiles);
  ExpectFailure(*camera, ErrorCode::kDevice, "two files, SCAN0001A.DNG and SCAN0001.DNG");
  ExpectNextFrameIsItsOwn(*camera);
}

TEST_F(PtpCameraFaults, ASleepingCameraIsGivenUpAndFoundAgainAwake) {
  const auto camera = Opened();
  camera->Close();
  options_.answer_timeout = milliseconds(1500);  // limit for a camera that never answers
  options_.settle = milliseconds(0);
  PtpCamera impatient(options_);
  ASSERT_TRUE(impatient.Open());
  Virtual().Inject(CameraFault::kAsleep);
  ExpectFailure(impatient, ErrorCode::kTimeout, "may be asleep", kShort);
  EXPECT_EQ(impatient.state(), State::kLost);
  Virtual().Wake();
  ExpectNextFrameIsItsOwn(impatient);
}

TEST_F(PtpCameraFaults, NothingAtThePortIsAnErrorThatSaysSo) {
  const std::string port = responder_->PortName();
  responder_.reset();
  const auto nothing = PtpCamera(options_).Open();
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, ErrorCode::kDevice);
  EXPECT_THAT(nothing.error().message, HasSubstr(port));
  options_.worker = "/nowhere/sateen-camera-worker";
  EXPECT_EQ(PtpCamera(options_).Open().error().code, ErrorCode::kIo);
}

}  // namespace
}  // namespace sateen::testing::ptp_camera_test
