#include "scanner/capture/capture_session.h"

#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "core/files/file_io.h"
#include "scanner/capture/session_proof.h"
#include "scanner/sessions/dataset.h"
#include "tests/scanner/sessions/dataset_files.h"
#include "tests/simulation/virtual_rig/capture_fakes.h"
#include "tests/testing/tree.h"

// A capture on the real firmware in simulated time.
namespace sateen::testing::capture_session_test {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

class CaptureTest : public BoardTest {
 protected:
  CaptureTest() : rig_(CaptureRig()), camera_(*board_, LightImages(rig_)) {
    WriteText(rig_file_, RigToJson(rig_));
    host_.emplace(std::make_unique<SimulatedPort>(*board_));
  }

  Result<CaptureSummary> Run(Result<CaptureSession> session, const Task& task = {.threads = 1}) {
    if (!session) {
      return tl::unexpected(session.error());
    }
    const Result<CaptureSummary> summary = session->Run(*host_, camera_, task);
    EXPECT_THAT(board_->Lit(), IsEmpty());
    return summary;
  }
  Result<CaptureSummary> Begin(const CaptureOptions& options = QuickCapture(),
                               const Task& task = {.threads = 1}) {
    return Run(CaptureSession::Begin(dir_, rig_file_, options), task);
  }
  Result<CaptureSummary> Resume() { return Run(CaptureSession::Resume(dir_, QuickCapture())); }

  static Error ErrorOf(const Result<CaptureSummary>& summary) {
    EXPECT_FALSE(summary);
    return summary ? Error{ErrorCode::kInvalidArgument, "none"} : summary.error();
  }

  TempFolder temp_;
  fs::path dir_ = temp_.Path() / "twill";
  fs::path rig_file_ = temp_.Path() / "rig.json";
  Rig rig_;
  LitCamera camera_;
  std::optional<LightBoard> host_;
};

TEST_F(CaptureTest, TakesEveryFrameOfThePlanByItsOwnLight) {
  const Result<CaptureSummary> summary = Begin();
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_EQ(summary->taken, 13);
  EXPECT_EQ(summary->rejected, 0);
  ASSERT_THAT(summary->session.frames, SizeIs(13));
  EXPECT_EQ(summary->session.frames[0].file, "frames/00-dark.dng");
  EXPECT_EQ(summary->session.frames[1].file, "frames/01-led-0.dng");
  EXPECT_EQ(summary->session.frames[11].file, "frames/11-led-0-again.dng");
  EXPECT_EQ(summary->session.frames[11].role, FrameRole::kRepeat);
  EXPECT_EQ(summary->session.frames[12].role, FrameRole::kDark);
  const std::vector<ChannelRecord> records = board_->Records();
  for (size_t k = 0; k < rig_.lights.size(); ++k) {
    EXPECT_EQ(records[k].times_on, k == 0 ? 2 : 1) << k;
  }
  EXPECT_EQ(*VerifySession(dir_, {}), 14);  // 13 frames and the rig
  EXPECT_THAT(Listing(dir_), Not(Contains(HasSubstr(".sateen"))));
  // Frames that solves read: each is the picture of its light, to the noise of a site.
  const Dataset dataset = MustRead(dir_);
  ASSERT_THAT(dataset.stack, SizeIs(10));
  const std::vector<Image3> images = LightImages(rig_);
  for (size_t k = 0; k < 10; ++k) {
    double seen = 0.0;
    double given = 0.0;
    for (size_t p = 0; p < kCapturePx.PixelCount(); ++p) {
      seen += double{dataset.stack[k].rgb[1].pixels[p]};
      given += double{images[k][1].pixels[p]};
    }
    const double exposure = summary->session.frames[k + 1].Exposure();
    EXPECT_NEAR(seen * exposure * kCaptureScale / given, 1.0, 0.02) << k;
  }
}

TEST_F(CaptureTest, KeepsSettingsAndLevelInTheRecord) {
  CaptureOptions options = QuickCapture();
  options.kind = SessionKind::kSheet;
  options.level = 0.5;
  options.exposure_s = 0.04;
  options.f_number = 5.6;
  options.iso = 200.0;
  const Result<CaptureSummary> summary = Begin(options);
  ASSERT_TRUE(summary) << summary.error().message;
  const Result<Session> session = ReadSession(dir_);
  ASSERT_TRUE(session);
  EXPECT_EQ(session->kind, SessionKind::kSheet);
  EXPECT_EQ(session->frames[4].f_number, 5.6);
  EXPECT_EQ(session->frames[4].iso, 200.0);
  EXPECT_EQ(session->frames[4].exposure_s, 0.04);
  EXPECT_NEAR(board_->Records()[3].highest_level, 0.5, 1e-9);
}

// The brightest light's 99.9th percentile lies just below its goal, on a camera of third
// stops.
TEST_F(CaptureTest, FindsTheExposure) {
  camera_.exposure_counts = true;
  camera_.times_s = ThirdStops();
  CaptureOptions options = QuickCapture();
  options.exposure_s.reset();
  double peak = 0.0;
  std::vector<std::string> stages;
  Result<CaptureSession> session = CaptureSession::Begin(dir_, rig_file_, options);
  ASSERT_TRUE(session);
  const Result<CaptureSummary> summary =
      session->Run(*host_, camera_, {.threads = 1}, [&](const CaptureEvent& event) {
        peak = std::max(peak, event.peak);
        if (stages.empty() || stages.back() != event.stage) {
          stages.push_back(event.stage);
        }
      });
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_THAT(stages, ::testing::ElementsAre("metering", "capturing", "checking"));
  EXPECT_LE(peak, 0.85);
  EXPECT_GT(peak, 0.8 / std::cbrt(2.0) - 0.02);
  EXPECT_THAT(summary->session.frames, SizeIs(13));
  EXPECT_TRUE(VerifySession(dir_, {}));
}

// Without its mark, the folder of a run that is killed later would stay for ever.
TEST_F(CaptureTest, MeteringLeavesTheMarkOfTheHiddenFolder) {
  CaptureOptions options = QuickCapture();
  options.exposure_s.reset();
  camera_.exposure_counts = true;
  camera_.times_s = ThirdStops();
  int looks = 0;
  Result<CaptureSession> session = CaptureSession::Begin(dir_, rig_file_, options);
  ASSERT_TRUE(session);
  camera_.on_exposed = [&](int /*capture*/) {
    ++looks;
    EXPECT_THAT(Listing(dir_), Contains(EndsWith("/.sateen-own"))) << looks;
  };
  const Result<CaptureSummary> summary = session->Run(*host_, camera_, {.threads = 1});
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_GT(looks, 13) << "it did not meter";
  EXPECT_THAT(Listing(dir_), Not(Contains(HasSubstr(".sateen"))));
}

// The rig has led-3 as one of ten alike; in truth it is much brighter.
TEST_F(CaptureTest, ALightThatIsBrighterThanTheRigSaysShortensTheExposure) {
  std::vector<Image3> images = LightImages(rig_);
  for (Image<float>& plane : images[3].planes) {
    for (float& value : plane.pixels) {
      value *= 1.35F;
    }
  }
  LitCamera camera(*board_, images);
  camera.exposure_counts = true;
  for (double time_s = 0.0005; time_s < 2.0; time_s *= 1.02) {
    camera.times_s.push_back(time_s);
  }
  CaptureOptions options = QuickCapture();
  options.exposure_s.reset();
  options.checks.max_level_change = 0.6;
  Result<CaptureSession> session = CaptureSession::Begin(dir_, rig_file_, options);
  ASSERT_TRUE(session);
  const Result<CaptureSummary> summary = session->Run(*host_, camera, {.threads = 1});
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_THAT(*ReadFileBytes(dir_ / kJournalFile), HasSubstr("exposure found with light 'led-3'"));
  std::set<double> exposures_s;
  for (const SessionFrame& frame : summary->session.frames) {
    exposures_s.insert(*frame.exposure_s);
  }
  EXPECT_THAT(exposures_s, SizeIs(1));  // all frames were taken again
  EXPECT_EQ(summary->taken, 13);
  EXPECT_EQ(summary->kept, 0);
  EXPECT_EQ(summary->rejected, 1);
  EXPECT_TRUE(VerifySession(dir_, {}));
}

// A scene of three exposures per light, killed in the middle and continued; a frame of an earlier
// plan does not stay.
TEST_F(CaptureTest, BracketsAScene) {
  std::vector<Image3> images = LightImages(rig_);
  for (Image3& image : images) {
    for (Image<float>& plane : image.planes) {
      for (size_t p = 0; p < plane.pixels.size(); ++p) {
        plane.pixels[p] *= p % static_cast<size_t>(plane.width) / 4 % 3 == 0 ? 5e-4F : 1.0F;
      }
    }
  }
  LitCamera camera(*board_, images);
  camera.exposure_counts = true;
  for (double time_s = 0.0005; time_s < 1.5; time_s *= 2.0) {
    camera.times_s.push_back(time_s);
  }
  CaptureOptions options = QuickCapture();
  options.exposure_s.reset();
  options.checks.min_shade = 1.0;  // dark stripes are all but noise at the shortest exposure
  std::atomic<bool> cancel = false;
  camera.on_exposed = [&](int capture) { cancel = capture == 9; };
  {
    Result<CaptureSession> killed = CaptureSession::Begin(dir_, rig_file_, options);
    ASSERT_TRUE(killed);
    EXPECT_EQ(ErrorOf(killed->Run(*host_, camera, {.threads = 1, .cancel = &cancel})).code,
              ErrorCode::kCancelled);
  }
  WriteText(dir_ / "frames" / "02-led-9.dng", "of nobody's plan");
  camera.on_exposed = {};
  Result<CaptureSession> session = CaptureSession::Resume(dir_, options);
  ASSERT_TRUE(session) << session.error().message;
  const Result<CaptureSummary> summary = session->Run(*host_, camera, {.threads = 1});
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_THAT(summary->session.frames, SizeIs(2 + 3 * 10 + 1));
  EXPECT_GT(summary->kept, 0);
  EXPECT_EQ(*summary->session.frames[0].exposure_s, *summary->session.frames[3].exposure_s);
  EXPECT_TRUE(fs::exists(dir_ / "frames" / "02-led-9.dng"));
  EXPECT_TRUE(VerifySession(dir_, {}));
  EXPECT_THAT(MustRead(dir_).stack, SizeIs(10));
}

// A mask that a person adds to a session is no damage, and stays.
TEST_F(CaptureTest, KeepsWhatAPersonAddedToTheRecord) {
  ASSERT_TRUE(Begin());
  Result<Session> session = ReadSessionRecord(dir_);
  ASSERT_TRUE(session);
  session->mask = "mask.png";
  WriteText(dir_ / "session.json", SessionToJson(*session));
  EXPECT_TRUE(VerifySession(dir_, {}));
  Result<CaptureSession> again = CaptureSession::Resume(dir_, QuickCapture());
  ASSERT_TRUE(again && again->Finish());
  EXPECT_EQ(ReadSessionRecord(dir_)->mask, "mask.png");
}

TEST_F(CaptureTest, ACameraWithoutExposureTimesNeedsOne) {
  CaptureOptions options = QuickCapture();
  options.exposure_s.reset();
  EXPECT_THAT(ErrorOf(Begin(options)), IsError(ErrorCode::kInvalidArgument, "--exposure"));
  EXPECT_TRUE(Begin());  // there was nothing to lose
}

TEST_F(CaptureTest, ABoardThatRestartsInAnExposureCostsOneFrame) {
  camera_.on_exposed = [&](int capture) {
    if (capture == 4) {
      board_->Reset(ResetCause::kBrownOut);
      board_->RunFor(milliseconds(20));
    }
  };
  const Result<CaptureSummary> summary = Begin();
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_EQ(summary->rejected, 1);
  EXPECT_EQ(camera_.captures, 14);
  EXPECT_TRUE(VerifySession(dir_, {}));
}

TEST_F(CaptureTest, ALightThatGoesOffTooSoonDoesNotCount) {
  CaptureOptions options = QuickCapture();
  options.margin = milliseconds(1);  // the camera delivers later than that
  camera_.on_exposed = [&](int) { board_->RunFor(milliseconds(30)); };
  const Error error = ErrorOf(Begin(options));
  EXPECT_THAT(error, IsError(ErrorCode::kDevice, "--margin"));
  EXPECT_THAT(error.message, HasSubstr("frame 2 of 13 (led-0)"));
  EXPECT_FALSE(fs::exists(dir_ / "session.json"));
}

TEST_F(CaptureTest, ACameraThatFailsIsAskedAgainAndThenNamed) {
  const Status busy = Fail(ErrorCode::kDevice, "camera is busy");
  camera_.fail_next = {busy, busy, Status()};  // the second capture, twice
  const Result<CaptureSummary> summary = Begin();
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_EQ(summary->rejected, 2);
  EXPECT_EQ(camera_.opened, 2);
  fs::remove_all(dir_);
  camera_.fail_next = {busy, busy, busy, Status()};
  const Error error = ErrorOf(Begin());
  EXPECT_EQ(error.code, ErrorCode::kDevice);
  EXPECT_EQ(error.message,
            "frame 2 of 13 (led-0): camera is busy; tried 3 times; then continue: sateen capture "
            "--resume " +
                dir_.string());
  const Result<CaptureSummary> resumed = Resume();
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(resumed->kept, 1);
  EXPECT_EQ(resumed->taken, 12);
}

TEST_F(CaptureTest, WithoutAFrameTheSameCommandDoes) {
  const Status busy = Fail(ErrorCode::kDevice, "camera is busy");
  camera_.fail_next = {busy, busy, busy};
  const Error error = ErrorOf(Begin());
  EXPECT_THAT(error, IsError(ErrorCode::kDevice, "run the same command again"));
  EXPECT_THAT(error.message, Not(HasSubstr("--resume")));
  EXPECT_TRUE(Begin());
}

TEST_F(CaptureTest, AFullCardIsNotTriedAgain) {
  camera_.fail_next = {Fail(ErrorCode::kDevice, "card is full"), Status()};
  camera_.needs_a_person = true;
  EXPECT_THAT(ErrorOf(Begin()), IsError(ErrorCode::kDevice, "card is full; then continue: "));
  EXPECT_EQ(camera_.captures, 2);
  EXPECT_EQ(camera_.opened, 0);
}

TEST_F(CaptureTest, AFullDiskIsNotTriedAgain) {
  camera_.fail_next = {Fail(ErrorCode::kIo, "No space left on device; make room"), Status()};
  const Error error = ErrorOf(Begin());
  EXPECT_THAT(error, IsError(ErrorCode::kIo,
                             "make room; then continue: sateen capture --resume " + dir_.string()));
  EXPECT_EQ(camera_.captures, 2);
  const Result<CaptureSummary> resumed = Resume();
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(resumed->kept, 1);
}

// An exposure that clips is no dead end: another one, and plain resumes keep to it.
TEST_F(CaptureTest, AnotherExposureTakesEveryFrameAgain) {
  camera_.exposure_counts = true;
  CaptureOptions options = QuickCapture();
  options.exposure_s = 0.4;
  const Error clipped = ErrorOf(Begin(options));
  EXPECT_THAT(clipped, IsError(ErrorCode::kBadData, "frame 2 of 13 (led-0): "));
  EXPECT_THAT(clipped.message,
              ::testing::EndsWith("sateen capture --resume " + dir_.string() + " --exposure auto"));
  EXPECT_LE(camera_.captures, 3);  // the dark, the clipped one, and the one begun meanwhile
  std::atomic<bool> cancel = false;
  camera_.on_exposed = [&, until = camera_.captures + 4](int capture) {
    cancel = capture == until;
  };
  {
    Result<CaptureSession> session = CaptureSession::Resume(dir_, QuickCapture());
    ASSERT_TRUE(session && session->ChangeExposure(0.02));
    EXPECT_EQ(session->AskedExposure(), 0.02);
    EXPECT_EQ(ErrorOf(session->Run(*host_, camera_, {.threads = 1, .cancel = &cancel})).code,
              ErrorCode::kCancelled);
  }
  camera_.on_exposed = {};
  const Result<CaptureSummary> resumed = Resume();
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(resumed->kept, 4);
  for (const SessionFrame& frame : resumed->session.frames) {
    EXPECT_EQ(frame.exposure_s, 0.02);
  }
  EXPECT_TRUE(VerifySession(dir_, {}));
  Result<CaptureSession> complete = CaptureSession::Resume(dir_, QuickCapture());
  ASSERT_TRUE(complete);
  EXPECT_THAT(complete->ChangeExposure(0.01).error(),
              IsError(ErrorCode::kInvalidArgument, "is a complete session"));
}

TEST_F(CaptureTest, AnExposureThatIsFoundInsteadOfOneByHand) {
  camera_.exposure_counts = true;
  CaptureOptions options = QuickCapture();
  options.exposure_s = 0.4;
  ASSERT_FALSE(Begin(options));
  for (double time_s = 0.0005; time_s < 2.0; time_s *= 1.2) {
    camera_.times_s.push_back(time_s);
  }
  Result<CaptureSession> session = CaptureSession::Resume(dir_, QuickCapture());
  ASSERT_TRUE(session && session->ChangeExposure(std::nullopt));
  const Result<CaptureSummary> summary = session->Run(*host_, camera_, {.threads = 1});
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_EQ(summary->taken, 13);
  EXPECT_LT(*summary->session.frames[1].exposure_s, 0.4);
  EXPECT_FALSE((*ReadJournal(dir_))->begun.exposure_s);
}

TEST_F(CaptureTest, StopsWhenAskedWithWhatItHas) {
  std::atomic<bool> cancel = false;
  camera_.on_exposed = [&](int capture) { cancel = capture == 5; };
  const Error error = ErrorOf(Begin(QuickCapture(), {.threads = 1, .cancel = &cancel}));
  EXPECT_THAT(error, IsError(ErrorCode::kCancelled, "--resume"));
  EXPECT_THAT(ReadSession(dir_).error(), IsError(ErrorCode::kBadData, "not completed"));
  camera_.on_exposed = {};
  const Result<CaptureSummary> resumed = Resume();
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(resumed->kept, 5);
}

TEST_F(CaptureTest, SwappedLightsAreNamedAndOnlyTheyAreTakenAgain) {
  camera_.image_of_channel = {0, 1, 7, 3, 4, 5, 6, 2, 8, 9};
  const Error error = ErrorOf(Begin());
  EXPECT_THAT(error, IsError(ErrorCode::kBadData,
                             "frame of light 'led-2' is lit from the position of light 'led-7'"));
  EXPECT_THAT(error.message, HasSubstr("'led-7' is lit from the position of light 'led-2'"));
  camera_.image_of_channel.clear();  // fixed
  const Result<CaptureSummary> resumed = Resume();
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(resumed->taken, 2);
  EXPECT_EQ(resumed->kept, 11);
  EXPECT_TRUE(VerifySession(dir_, {}));
}

TEST_F(CaptureTest, AFrameThatChangedIsTakenAgain) {
  std::atomic<bool> cancel = false;
  camera_.on_exposed = [&](int capture) { cancel = capture == 5; };
  ASSERT_FALSE(Begin(QuickCapture(), {.threads = 1, .cancel = &cancel}));
  camera_.on_exposed = {};
  CutShort(dir_ / "frames" / "02-led-1.dng", 100);
  fs::remove(dir_ / "frames" / "03-led-2.dng");
  const Result<CaptureSummary> resumed = Resume();
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(resumed->kept, 3);
  EXPECT_TRUE(VerifySession(dir_, {}));
}

TEST_F(CaptureTest, SaturationAndAnotherExposureDoNotCount) {
  CaptureOptions options = QuickCapture();
  options.checks.max_saturated = 1e-9;
  std::vector<Image3> bright = LightImages(rig_);
  bright[3][1].At(40, 30) = 10.0F;  // a site
  bright[3][1].At(41, 30) = 10.0F;
  LitCamera camera(*board_, bright);
  Result<CaptureSession> session = CaptureSession::Begin(dir_, rig_file_, options);
  ASSERT_TRUE(session);
  EXPECT_THAT(ErrorOf(session->Run(*host_, camera, {.threads = 1})),
              IsError(ErrorCode::kBadData, "(led-3)"));
}

TEST_F(CaptureTest, DoesNotTouchASessionThatIsThere) {
  ASSERT_TRUE(Begin());
  EXPECT_THAT(ErrorOf(Begin()), IsError(ErrorCode::kInvalidArgument, "holds a session already"));
  const int captures = camera_.captures;
  const Result<CaptureSummary> resumed = Resume();  // nothing is left to do
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(camera_.captures, captures);
  EXPECT_TRUE(VerifySession(dir_, {}));
}

TEST_F(CaptureTest, DoesNotCaptureOverFramesOfWhichNoJournalTells) {
  fs::create_directories(dir_ / "frames");
  WriteText(dir_ / "frames" / "01-led-0.dng", "precious");
  const Error error = ErrorOf(Begin());
  EXPECT_EQ(error.code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(error.message, HasSubstr("holds 1 files"));
  EXPECT_EQ(fs::file_size(dir_ / "frames" / "01-led-0.dng"), 8U);
  EXPECT_FALSE(fs::exists(dir_ / "journal.jsonl"));
}

TEST_F(CaptureTest, ACompleteSessionThatLostAFrameSaysWhatToDo) {
  ASSERT_TRUE(Begin());
  fs::remove(dir_ / "frames" / "04-led-3.dng");
  Result<CaptureSession> session = CaptureSession::Resume(dir_, QuickCapture());
  ASSERT_TRUE(session) << session.error().message;
  const Error error = ErrorOf(session->Finish());
  EXPECT_THAT(error.message, HasSubstr("04-led-3.dng"));
  EXPECT_THAT(error.message, HasSubstr("restore the file, or capture again"));
}

TEST_F(CaptureTest, RefusesRigsAndOptionsThatCannotBe) {
  Rig twice = rig_;
  twice.lights[4].channel = 2;
  WriteText(rig_file_, RigToJson(twice));
  EXPECT_THAT(ErrorOf(Begin()), IsError(ErrorCode::kBadData, "'led-2' and 'led-4' both have"));
  WriteText(rig_file_, RigToJson(rig_));
  CaptureOptions options = QuickCapture();
  options.tries = 0;
  EXPECT_THAT(ErrorOf(Begin(options)), IsError(ErrorCode::kInvalidArgument, "tries = 0"));
  EXPECT_THAT(ErrorOf(Resume()), IsError(ErrorCode::kIo, "journal.jsonl"));
  EXPECT_FALSE(fs::exists(dir_));
}

// Each damage of a session on disk is named.
TEST_F(CaptureTest, VerifyNamesEachDamage) {
  const auto expect = [&](const std::function<void()>& damage, const std::string& part) {
    fs::remove_all(dir_);
    ASSERT_TRUE(Begin());
    damage();
    const Result<int> verified = VerifySession(dir_, {});
    ASSERT_FALSE(verified) << part;
    EXPECT_THAT(verified.error(), IsError(ErrorCode::kBadData, part));
  };
  const auto replace = [&](const char* file, const std::string& from, const std::string& to) {
    return [this, file, from, to] {
      std::string text = *ReadFileBytes(dir_ / file);
      const size_t at = text.find(from);
      ASSERT_NE(at, std::string::npos);
      WriteText(dir_ / file, text.replace(at, from.size(), to));
    };
  };
  expect([&] { CutShort(dir_ / "frames/05-led-4.dng", 500); }, "05-led-4.dng: its SHA-256");
  expect([&] { fs::remove(dir_ / "frames/12-dark.dng"); }, "12-dark.dng");
  expect([&] { fs::remove(dir_ / "session.json"); }, "not completed");
  expect([&] { fs::remove(dir_ / "rig.json"); }, "rig.json");
  expect(replace("rig.json", "led-3", "led-x"), "rig.json: its SHA-256");
  expect(replace("session.json", "\"iso\": 100.0", "\"iso\": 101.0"),
         "has other frames than session.json");
  expect(replace("journal.jsonl", "\"iso\":100.0}}", "\"iso\":101.0}}"),
         "has other frames than session.json");
  expect(replace("journal.jsonl", "{\"record\":\"complete\"}\n", ""),
         "continue it: sateen capture --resume");
  expect([&] { fs::remove(dir_ / "journal.jsonl"); }, "journal.jsonl: is missing");
  const auto lead_out = [&](const char* name) {
    return [this, name] {
      const fs::path far = temp_.Path() / "far" / name;
      fs::create_directories(far.parent_path());
      fs::remove_all(far);
      fs::rename(dir_ / name, far);
      fs::create_symlink(far, dir_ / name);
    };
  };
  expect(lead_out("frames/05-led-4.dng"), "frames/05-led-4.dng lies outside of the session");
  expect(lead_out("frames"), "frames/00-dark.dng lies outside of the session");
  expect(lead_out("rig.json"), "rig.json lies outside of the session");
  const auto name_outside = [&](const std::string& place) {
    return [this, place] {
      Session session = *ReadSessionRecord(dir_);
      session.frames[5].file = place;
      WriteText(dir_ / "session.json", SessionToJson(session));
    };
  };
  for (const fs::path& place :
       {dir_ / "frames/05-led-4.dng", fs::path("../twill/frames/05-led-4.dng"),
        fs::path("frames/../../twill/frames/05-led-4.dng")}) {
    expect(name_outside(place), place.string() + " lies outside of the session");
  }
  // Captures of before did not name their journal.
  fs::remove_all(dir_);
  ASSERT_TRUE(Begin());
  Session session = *ReadSessionRecord(dir_);
  EXPECT_TRUE(session.has_journal);
  session.has_journal = false;
  WriteText(dir_ / "session.json", SessionToJson(session));
  EXPECT_TRUE(VerifySession(dir_, {}));
  fs::remove(dir_ / "journal.jsonl");
  EXPECT_TRUE(VerifySession(dir_, {}));
}

}  // namespace
}  // namespace sateen::testing::capture_session_test
