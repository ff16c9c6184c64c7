#include "scanner/sessions/session_layout.h"

#include <algorithm>
#include <cmath>

#include "core/sha256.h"
#include "rig/projection.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::session_layout_test {
namespace {

namespace fs = std::filesystem;

using ::testing::ElementsAre;
using testing::FailureOf;
using testing::FourLightSession;
using ::testing::HasSubstr;
using testing::IsError;
using ::testing::SizeIs;
using testing::TempFolder;
using testing::WriteFlat;
using testing::WriteText;

class SessionLayout : public ::testing::Test {
 protected:
  void Write(const Session& session) { testing::WriteSession(dir_, session); }
  Dataset MustRead(const ReadDatasetOptions& options = {}) {
    return testing::MustRead(dir_, options);
  }
  static float ValueOf(const LightFrame& frame) { return frame.rgb[0].At(1, 1); }

  TempFolder temp_;
  fs::path dir_ = temp_.Path() / "linen-07";
};

TEST_F(SessionLayout, SubtractsTheDarkFrameAndKeepsTheRecord) {
  Write(FourLightSession());
  const Dataset dataset = MustRead();
  EXPECT_EQ(dataset.layout, "session");
  ASSERT_THAT(dataset.stack, SizeIs(4));
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_FLOAT_EQ(ValueOf(dataset.stack[k]), 0.1F * static_cast<float>(k + 1) - 0.05F);
  }
  EXPECT_EQ(dataset.rig.lights[3].name, "south");
  ASSERT_TRUE(dataset.session);
  EXPECT_THAT(dataset.session->frames, SizeIs(5));
}

TEST_F(SessionLayout, FollowsTheOrderOfTheRigNotOfTheFrames) {
  Session session = FourLightSession();
  std::reverse(session.frames.begin(), session.frames.end());
  Write(session);
  const Dataset dataset = MustRead();
  EXPECT_FLOAT_EQ(ValueOf(dataset.stack[0]), 0.05F);
  EXPECT_THAT(dataset.stack[0].name, HasSubstr("east.exr"));
}

// The frames need not be there yet.
TEST_F(SessionLayout, FindsTheRepeatOfALightThatIsRawAndOfOneExposure) {
  Session session = FourLightSession();
  EXPECT_FALSE((Write(session), PlanSession(dir_, {}).value().repeated));
  SessionFrame again = session.frames[1];
  again.role = FrameRole::kRepeat;
  again.file = "frames/again.exr";
  session.frames.push_back(again);
  EXPECT_FALSE((Write(session), PlanSession(dir_, {}).value().repeated));
  session.frames[1].file = "frames/west.dng";
  session.frames.back().file = "frames/again.dng";
  fs::create_directories(dir_);
  WriteText(dir_ / "session.json", SessionToJson(session));
  const ReadPlan plan = PlanSession(dir_, {}).value();
  ASSERT_TRUE(plan.repeated);
  EXPECT_EQ(plan.repeated->first.path, dir_ / "frames/west.dng");
  EXPECT_EQ(plan.repeated->again.path, dir_ / "frames/again.dng");
  for (SessionFrame& frame : session.frames) {
    frame.exposure_s = frame.role == FrameRole::kRepeat ? 0.5 : 1.0;
  }
  WriteText(dir_ / "session.json", SessionToJson(session));
  EXPECT_FALSE(PlanSession(dir_, {}).value().repeated);
}

TEST_F(SessionLayout, DividesByExposureBeforeTheDarkFrameIsSubtracted) {
  Session session = FourLightSession();
  for (SessionFrame& frame : session.frames) {
    frame.exposure_s = frame.role == FrameRole::kDark ? 1.0 : 0.5;
    frame.f_number = 2;
    frame.iso = frame.light == "west" ? 400 : 200;
  }
  Write(session);
  const Dataset dataset = MustRead();
  // H: east 0.5 * 2 / 4 = 0.25, west 0.5, dark 1 * 2 / 4 = 0.5.
  EXPECT_FLOAT_EQ(ValueOf(dataset.stack[0]), 0.1F / 0.25F - 0.05F / 0.5F);
  EXPECT_FLOAT_EQ(ValueOf(dataset.stack[1]), 0.2F / 0.5F - 0.05F / 0.5F);
}

TEST_F(SessionLayout, SubtractsTheMeanOfSeveralDarkFrames) {
  Session session = FourLightSession();
  session.frames.push_back(session.frames.back());
  session.frames.back().file = "frames/dark2.exr";
  Write(session);
  WriteFlat(dir_ / "frames/dark2.exr", 0.07F);
  EXPECT_FLOAT_EQ(ValueOf(MustRead().stack[0]), 0.1F - 0.06F);
}

TEST_F(SessionLayout, FullScaleIsRadianceAndSaturatedSamplesStayThere) {
  Session session = FourLightSession();
  session.frames[0].file = "frames/east.png";
  for (SessionFrame& frame : session.frames) {
    frame.exposure_s = 0.5;
  }
  Write(session);
  Image<uint16_t> plane(testing::kSize, 32768);
  plane.At(1, 1) = 65535;
  ASSERT_TRUE(WritePng16(dir_ / "frames/east.png", {plane, plane, plane}));
  const Dataset dataset = MustRead();
  EXPECT_FLOAT_EQ(dataset.stack[0].full_scale, 2.0F);
  EXPECT_EQ(ValueOf(dataset.stack[0]), dataset.stack[0].full_scale);
  EXPECT_NEAR(dataset.stack[0].rgb[0].At(0, 0), 1.0F - 0.1F, 2e-5F);  // 32768 / 65535 is not 1/2
  EXPECT_TRUE(std::isinf(dataset.stack[1].full_scale));
}

TEST_F(SessionLayout, VerifiesHashesWhereTheyAreRecorded) {
  Session session = FourLightSession();
  Write(session);
  session.frames[2].sha256 = Sha256OfFile(dir_ / "frames/north.exr").value();
  session.frames[4].sha256 = Sha256OfFile(dir_ / "frames/dark.exr").value();
  session.rig_sha256 = Sha256OfFile(temp_.Path() / "rig.json").value();
  Write(session);
  MustRead();
  WriteFlat(dir_ / "frames/north.exr", 0.31F);
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "frames/north.exr: its SHA-256 is"));
  WriteFlat(dir_ / "frames/north.exr", 0.3F);
  WriteFlat(dir_ / "frames/dark.exr", 0.06F);
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "frames/dark.exr: its SHA-256 is"));
}

TEST_F(SessionLayout, RefusesARigThatHasChanged) {
  Session session = FourLightSession();
  session.rig_sha256 = std::string(64, 'a');
  Write(session);
  EXPECT_THAT(FailureOf(dir_),
              IsError(ErrorCode::kBadData, "the rig has changed since the capture"));
  MustRead({.rig_file = temp_.Path() / "rig.json"});  // one that the caller vouches for
}

TEST_F(SessionLayout, NamesTheLightWithoutAFrameUnlessItIsNotUsed) {
  Session session = FourLightSession();
  session.frames.erase(session.frames.begin() + 2);
  Write(session);
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "no lit frame of light 'north'"));
  EXPECT_THAT(MustRead({.lights = {3, 0}}).stack, SizeIs(2));
}

TEST_F(SessionLayout, RefusesTwoFramesOfALightAndOneExposure) {
  Session session = FourLightSession();
  session.frames[2].light = "east";
  Write(session);
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData,
                                       "frames frames/east.exr and frames/north.exr are both of "
                                       "light 'east', with one exposure"));
}

// Four lights; of the first one more exposure, eight times as long.
class Bracketed : public SessionLayout {
 protected:
  Bracketed() {
    for (SessionFrame& frame : session_.frames) {
      frame.exposure_s = 0.5;
    }
    session_.frames[0].file = "frames/east.png";
    session_.frames.push_back(session_.frames[0]);
    session_.frames.back().file = "frames/east-long.png";
    session_.frames.back().exposure_s = 4.0;
  }
  // 16-bit readings at (1, 1) and elsewhere.
  void WriteEast(const std::string& name, uint16_t here, uint16_t elsewhere) {
    Image<uint16_t> plane(testing::kSize, elsewhere);
    plane.At(1, 1) = here;
    ASSERT_TRUE(WritePng16(dir_ / "frames" / name, {plane, plane, plane}));
  }
  Session session_ = FourLightSession();
};

TEST_F(Bracketed, AreMergedAsRadianceAndTheShortestSaysWhatSaturates) {
  Write(session_);
  WriteEast("east.png", 65535, 13107);       // 0.2 / 0.5 = 0.4
  WriteEast("east-long.png", 65535, 26214);  // 0.4 / 4 = 0.1
  const Dataset dataset = MustRead();
  ASSERT_THAT(dataset.stack, SizeIs(4));
  EXPECT_FLOAT_EQ(dataset.stack[0].full_scale, 2.0F);
  EXPECT_EQ(ValueOf(dataset.stack[0]), 2.0F);
  const float dark = 0.05F / 0.5F;
  EXPECT_NEAR(dataset.stack[0].rgb[0].At(0, 0), (0.4F * 0.5F + 0.1F * 4.0F) / 4.5F - dark, 1e-5F);
  EXPECT_EQ(dataset.sha256_of_input.count((dir_ / "frames/east-long.png").string()), 1U);
  WriteEast("east.png", 13107, 13107);
  EXPECT_NEAR(ValueOf(MustRead().stack[0]), 0.4F - dark, 1e-5F);  // the long one is saturated there
}

TEST_F(Bracketed, GiveTheSameBitsOnAnyNumberOfThreads) {
  Write(session_);
  WriteEast("east.png", 13107, 1311);
  WriteEast("east-long.png", 65535, 10486);
  const Dataset one = *ReadDataset(dir_, {}, {.threads = 1});
  const Dataset three = *ReadDataset(dir_, {}, {.threads = 3});
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(one.stack[k].rgb[1].pixels, three.stack[k].rgb[1].pixels);
  }
}

TEST_F(Bracketed, MustDifferInExposureTimeAlone) {
  for (SessionFrame& frame : session_.frames) {
    frame.iso = 100;
  }
  session_.frames.back().iso = 400;
  Write(session_);
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "differ in aperture or ISO"));
  session_.frames.back().iso = 100;
  session_.frames.back().shift_px = Eigen::Vector2d(0.3, 0.0);
  Write(session_);
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "with another shift_px"));
}

TEST_F(SessionLayout, WeighsDarkFramesByTheSquareOfTheirExposure) {
  Session session = FourLightSession();
  session.frames.push_back(session.frames.back());
  session.frames.back().file = "frames/dark2.exr";
  for (SessionFrame& frame : session.frames) {
    frame.exposure_s = 1.0;
  }
  session.frames.back().exposure_s = 3.0;
  Write(session);
  WriteFlat(dir_ / "frames/dark2.exr", 0.06F);
  EXPECT_NEAR(ValueOf(MustRead().stack[0]), 0.1F - (1.0F * 0.05F + 9.0F * 0.02F) / 10.0F, 1e-6F);
}

TEST_F(SessionLayout, LaysAFrameThatHasMovedOverTheFirst) {
  Session session = FourLightSession();
  session.frames[1].shift_px = Eigen::Vector2d(1.0, 0.0);
  Write(session);
  Image3 west(testing::kSize, 0.2F);
  west[0].At(2, 1) = 0.3F;
  ASSERT_TRUE(WriteExr(dir_ / "frames/west.exr", west));
  const Dataset dataset = MustRead();
  EXPECT_FLOAT_EQ(dataset.stack[1].rgb[0].At(1, 1), 0.3F - 0.05F);
  EXPECT_FLOAT_EQ(dataset.stack[1].rgb[0].At(2, 1), 0.2F - 0.05F);
  EXPECT_TRUE(std::isnan(dataset.stack[1].rgb[0].At(3, 1)));
}

TEST_F(SessionLayout, TakesTheTruthOfAnotherSession) {
  Write(FourLightSession());
  const fs::path other = temp_.Path() / "scene";
  fs::create_directories(other / "truth");
  EXPECT_THAT(FailureOf(dir_, {.truth_dir = other}),
              IsError(ErrorCode::kIo, "has no truth/normal.exr"));
  ASSERT_TRUE(WriteExr(other / "truth/normal.exr", testing::LevelNormals()));
  const Dataset dataset = MustRead({.truth_dir = other});
  ASSERT_TRUE(dataset.truth);
  EXPECT_EQ(dataset.truth->source, (other / "truth/normal.exr").string());
}

TEST_F(SessionLayout, RefusesALightThatTheRigHasNot) {
  Session session = FourLightSession();
  session.frames[2].light = "up";
  Write(session);
  EXPECT_THAT(FailureOf(dir_),
              IsError(ErrorCode::kBadData,
                      "of light 'up', which is not in the rig; its lights are east, "
                      "west, north, south"));
}

TEST_F(SessionLayout, MatchesAnotherRigByTheNamesOfItsLights) {
  Write(FourLightSession());
  Rig rig = testing::FourLights();
  std::reverse(rig.lights.begin(), rig.lights.end());
  WriteText(temp_.Path() / "new.json", RigToJson(rig));
  fs::remove(temp_.Path() / "rig.json");  // not needed then
  const Dataset dataset = MustRead({.rig_file = temp_.Path() / "new.json"});
  EXPECT_EQ(dataset.rig.lights[0].name, "south");
  EXPECT_FLOAT_EQ(ValueOf(dataset.stack[0]), 0.4F - 0.05F);
}

TEST_F(SessionLayout, WarnsOfARigThatIsNotTheSessions) {
  Write(FourLightSession());
  Rig own = testing::FourLights();
  for (Light& light : own.lights) {
    light.model = LightModel::kNear;
    light.position_mm = {0, 0, 600};
  }
  own.camera = Camera{.model = "a", .size_px = {4, 3}, .fx = 10, .fy = 10};
  own.camera->table_from_camera.translation().z() = 600;
  own.camera->has_pose = true;
  WriteText(temp_.Path() / "rig.json", RigToJson(own));
  const auto warnings = [&](const Rig& rig) {
    WriteText(temp_.Path() / "given.json", RigToJson(rig));
    const auto plan = PlanSession(dir_, {.rig_file = temp_.Path() / "given.json"});
    EXPECT_TRUE(plan) << plan.error().message;
    return plan->warnings;
  };
  Rig given = own;
  given.lights[2].position_mm.x() += 140.0;  // a rough rig
  given.camera->fx *= 1.09;
  EXPECT_THAT(warnings(given), SizeIs(0));
  given.lights[2].position_mm.x() += 20.0;
  EXPECT_THAT(warnings(given),
              ElementsAre(HasSubstr("its light 'north' is 160 mm from the session's")));
  given = own;
  given.camera->fx *= 0.8;
  given.camera->model = "b";
  given.lights[0].model = LightModel::kDistant;
  EXPECT_THAT(warnings(given),
              ElementsAre(HasSubstr("its camera is 'b', the session's is 'a'"),
                          HasSubstr("its focal length is 8 px, the session's is 10 px"),
                          HasSubstr("its light 'east' is distant, the session's is near")));
}

TEST_F(SessionLayout, ReadsMaskAndTruth) {
  Session session = FourLightSession();
  session.mask = "area.png";
  Write(session);
  testing::WriteMask(dir_ / "area.png");
  fs::create_directory(dir_ / "truth");
  ASSERT_TRUE(WriteExr(dir_ / "truth/normal.exr", testing::LevelNormals()));
  WriteFlat(dir_ / "truth/albedo.exr", 0.5F);
  const Dataset dataset = MustRead();
  EXPECT_TRUE(dataset.mask);
  ASSERT_TRUE(dataset.truth);
  ASSERT_TRUE(dataset.truth->albedo);
  EXPECT_EQ((*dataset.truth->albedo)[2].At(0, 0), 0.5F);
  EXPECT_THAT(dataset.sha256_of_input, SizeIs(10));  // record, rig, 4 + 1 frames, mask, 2 truths
}

TEST_F(SessionLayout, RefusesADarkFrameOfAnotherSize) {
  Write(FourLightSession());
  WriteFlat(dir_ / "frames/dark.exr", 0.05F, {5, 3});
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "dark.exr: is 5 x 3 px"));
}

TEST_F(SessionLayout, RefusesFramesThatAreNotOfTheCamera) {
  Rig rig = testing::FourLights();
  rig.camera = OverheadCamera({8, 6}, 500.0, 200.0);
  Write(FourLightSession());
  WriteText(temp_.Path() / "rig.json", RigToJson(rig));
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kBadData, "the rig's camera has 8 x 6 px"));
}

TEST_F(SessionLayout, SaysThatTheRigIsAbsent) {
  Write(FourLightSession());
  fs::remove(temp_.Path() / "rig.json");
  EXPECT_THAT(FailureOf(dir_), IsError(ErrorCode::kIo, "rig.json"));
}

}  // namespace
}  // namespace sateen::session_layout_test
