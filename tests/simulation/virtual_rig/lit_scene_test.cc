#include "simulation/virtual_rig/camera/lit_scene.h"

#include <gmock/gmock.h>

#include <future>

#include "imaging/raw.h"
#include "simulation/virtual_rig/camera/rig_camera.h"
#include "simulation/virtual_rig/camera/scene_camera.h"
#include "tests/simulation/virtual_rig/small_scene.h"

namespace sateen::testing::lit_scene_test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using ::testing::HasSubstr;

class LitSceneTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path Dir() const { return folder_.Path() / "scene"; }
  // Why it is not read.
  [[nodiscard]] std::string Refusal(ErrorCode code = ErrorCode::kBadData) const {
    const auto scene = ReadLitScene(Dir(), Sensor());
    EXPECT_FALSE(scene);
    EXPECT_EQ(scene ? code : scene.error().code, code);
    return scene ? "" : scene.error().message;
  }
  const TempFolder folder_;
};

TEST_F(LitSceneTest, EachLightAloneOneColourASite) {
  WriteSmallScene(Dir());
  const Sensor sensor{.cfa = {1, 0, 2, 1}, .full_scale = 2.0, .sensitivity_rgb = {0.5, 1.0, 0.8}};

  const auto scene = ReadLitScene(Dir(), sensor);

  ASSERT_TRUE(scene) << scene.error().message;
  ASSERT_EQ(scene->lights.size(), 10U);
  EXPECT_EQ(scene->rig.lights[3].name, "led-3");
  const auto site = [&](size_t k, int x, int y) { return scene->lights[k].At(x, y); };
  EXPECT_NEAR(site(3, 4, 6), 1.0 * SmallRadiance(3, 1, 4, 6) / 2.0, 1e-7);
  EXPECT_NEAR(site(3, 5, 6), 0.5 * SmallRadiance(3, 0, 5, 6) / 2.0, 1e-7);
  EXPECT_NEAR(site(9, 4, 7), 0.8 * SmallRadiance(9, 2, 4, 7) / 2.0, 1e-7);
  EXPECT_NEAR(scene->ambient.At(4, 7), 0.8 * kSmallAmbient / 2.0, 1e-8);
}

TEST_F(LitSceneTest, RefusesWhatIsNoSceneOfLinearFrames) {
  WriteSmallScene(Dir(), 0.0, [](Session& s, Rig&) { s.frames.pop_back(); });
  EXPECT_THAT(Refusal(), HasSubstr("has no dark frame; render it with sateen simulate SCENE"));
  WriteSmallScene(Dir(), 0.0, [](Session& s, Rig&) { s.frames.erase(s.frames.begin() + 4); });
  EXPECT_THAT(Refusal(), HasSubstr("has 0 frames of light 'led-4'"));
  WriteSmallScene(Dir(), 0.0, [](Session& s, Rig&) {
    for (SessionFrame& frame : s.frames) {
      frame.exposure_s = 0.02;
    }
  });
  EXPECT_THAT(Refusal(), HasSubstr("frame frames/led-0.exr was exposed"));
  WriteSmallScene(Dir(), 0.0, [](Session&, Rig& rig) { rig.camera->size_px = {80, 48}; });
  EXPECT_THAT(Refusal(), HasSubstr("is 64x48 px, the camera of the scene's rig 80x48"));
  WriteSmallScene(Dir());
  WriteText(Dir() / "frames/led-2.exr", "other");
  EXPECT_THAT(Refusal(), HasSubstr("the session recorded"));
  std::filesystem::remove(Dir() / "frames/led-2.exr");
  EXPECT_THAT(Refusal(ErrorCode::kIo), HasSubstr("led-2.exr"));
}

TEST_F(LitSceneTest, AnotherRigIsToldByWhatDiffers) {
  const Rig rig = SmallScene().rig;
  const auto refusal = [&](const std::function<void(Rig&)>& change) {
    Rig other = rig;
    change(other);
    const Status status = RequireSameRig(other, "b", rig, "a");
    return status ? "same" : status.error().message;
  };
  EXPECT_EQ(refusal([](Rig& r) { r.lights[3].flux_rgb *= 2.0; }), "same");
  EXPECT_THAT(refusal([](Rig& r) { r.lights.pop_back(); }), HasSubstr("b: has 9 lights, a has 10"));
  EXPECT_THAT(refusal([](Rig& r) { r.lights[3].name = "x"; }), HasSubstr("light 'x' is not in a"));
  EXPECT_THAT(refusal([](Rig& r) { std::swap(r.lights[3].channel, r.lights[4].channel); }),
              HasSubstr("light 'led-3' is on channel 4, in a on 3"));
  EXPECT_THAT(refusal([](Rig& r) { r.camera->size_px.width = 80; }),
              HasSubstr("its camera has 80x48 px, that of a 64x48"));
}

TEST(SensorOf, TakesTheResponseOfTheRigUnlessAnotherIsNamed) {
  Rig rig;
  const auto named = SensorOf({.full_scale = 2.0}, rig);
  ASSERT_TRUE(named);
  EXPECT_EQ(named->white_dn, 15892);
  EXPECT_EQ(named->full_scale, 2.0);
  rig.response = {.black = 200, .white = 4000, .read_noise_dn = 4.0, .gain_dn_per_electron = 0.5};
  const auto own = SensorOf({}, rig);
  ASSERT_TRUE(own) << own.error().message;
  EXPECT_EQ(own->bits, 12);
  EXPECT_EQ(own->black_dn, 200);
  EXPECT_EQ(*own->full_well_electrons, 7600);
  EXPECT_EQ(own->read_noise_electrons, 8.0);
  EXPECT_EQ(SensorOf({.sensor = "nikon-d5100", .black_dn = 600}, rig)->black_dn, 600);
  EXPECT_THAT(SensorOf({.sensor = "x"}, rig).error().message, HasSubstr("'x' is no sensor"));
  EXPECT_THAT(SensorOf({.black_dn = 1e5}, rig).error().message, HasSubstr("black"));
}

// Camera of a scene on disk, lit as a board would light it; H of the reference.
class SceneCameraTest : public ::testing::Test {
 protected:
  static constexpr LightLog::Time kOpen = LightLog::Time(hours(1));

  SceneCameraTest() : log_(14), camera_(SmallScene(), Sensor(), log_) {
    log_.KnownUntil(kOpen + hours(1));
  }
  void SetOn(int channel, double level, milliseconds when = milliseconds(-500)) {
    log_.Changed(kOpen + when, channel, level);
  }
  Image<float> Frame(FrameRequest request = {}) {
    request = {.number = ++number_,
               .exposure_s = request.exposure_s > 0.0 ? request.exposure_s : 0.02,
               .f_number = request.f_number > 0.0 ? request.f_number : 8.0,
               .iso = request.iso > 0.0 ? request.iso : 100.0,
               .begin = kOpen};
    request.end = kOpen + std::chrono::duration_cast<LightLog::Clock::duration>(
                              std::chrono::duration<double>(request.exposure_s));
    const auto bytes = camera_.Frame(request);
    EXPECT_TRUE(bytes) << bytes.error().message;
    const auto path = folder_.Path() / "frame.dng";
    WriteText(path, *bytes);
    const auto mosaic = ReadRawMosaic(path);
    EXPECT_TRUE(mosaic) << mosaic.error().message;
    EXPECT_NEAR(*mosaic->exposure_s, request.exposure_s, 1e-7);
    EXPECT_EQ(*mosaic->iso, request.iso);
    return mosaic->samples;
  }
  double Red(const FrameRequest& request = {}) { return Frame(request).At(10, 10); }
  static double RedOf(size_t light) { return SmallRadiance(light, 0, 10, 10); }

  const TempFolder folder_;
  LightLog log_;
  SceneCamera camera_;
  int number_ = 0;
};

constexpr double kOneReading = 1.0 / 65535.0;

TEST_F(SceneCameraTest, SeesTheLightThatIsOnAndTheAmbientLight) {
  EXPECT_NEAR(Red(), kSmallAmbient, kOneReading);
  SetOn(3, 1.0);
  EXPECT_NEAR(Red(), RedOf(3) + kSmallAmbient, kOneReading);
  SetOn(12, 1.0);  // a channel without a light of the rig
  EXPECT_NEAR(Red(), RedOf(3) + kSmallAmbient, kOneReading);
  ASSERT_TRUE(camera_.SetAmbient(3.0));
  EXPECT_NEAR(Red(), RedOf(3) + 3 * kSmallAmbient, kOneReading);
}

TEST_F(SceneCameraTest, ALightThatGoesOnHalfWayGivesHalf) {
  SetOn(3, 1.0, milliseconds(10));
  EXPECT_NEAR(Red(), 0.5 * RedOf(3) + kSmallAmbient, kOneReading);
}

TEST_F(SceneCameraTest, ExposureGoesWithTimeIsoAndAperture) {
  SetOn(3, 1.0);
  const double once = RedOf(3) + kSmallAmbient;
  EXPECT_NEAR(Red({.exposure_s = 0.04}), 2.0 * once, kOneReading);
  EXPECT_NEAR(Red({.iso = 400}), 4.0 * once, kOneReading);
  EXPECT_NEAR(Red({.f_number = 16}), 0.25 * once, kOneReading);
}

TEST_F(SceneCameraTest, AnotherFrameOfTheSameIsTheSameFile) {
  SceneCamera camera(SmallScene(), *SensorNamed("nikon-d5100"), log_);
  SetOn(3, 1.0);
  const auto frame = [&](int number, milliseconds begin) {
    return *camera.Frame({.number = number,
                          .exposure_s = 0.02,
                          .f_number = 8,
                          .iso = 100,
                          .begin = kOpen + begin,
                          .end = kOpen + begin + milliseconds(20)});
  };
  const std::string first = frame(1, milliseconds(0));
  EXPECT_EQ(frame(2, milliseconds(33)), first);
  SetOn(3, 0.5, milliseconds(100));
  EXPECT_NE(frame(3, milliseconds(200)), first);
}

TEST_F(SceneCameraTest, WiringDimmingAndDoublesAddUp) {
  SetOn(3, 1.0);
  camera_.Dim(3, 0.8);
  EXPECT_NEAR(Red(), 0.8 * RedOf(3) + kSmallAmbient, kOneReading);
  camera_.Swap(3, 5);
  EXPECT_NEAR(Red(), RedOf(5) + kSmallAmbient, kOneReading);
  camera_.Double(3, 6);
  EXPECT_NEAR(Red(), RedOf(5) + RedOf(6) + kSmallAmbient, kOneReading);
  camera_.Swap(3, 5);
  EXPECT_NEAR(Red(), 0.8 * RedOf(3) + kSmallAmbient, kOneReading);
}

TEST_F(SceneCameraTest, NudgesStayAndShadesPass) {
  SetOn(3, 1.0);
  const Image<float> before = Frame();
  camera_.Nudge(2, 0);
  camera_.Nudge(2, -2);
  EXPECT_EQ(Frame().At(20, 20), before.At(16, 22));
  camera_.Nudge(-4, 2);
  camera_.Shade({.x_px = 10, .y_px = 10, .radius_px = 3, .factor = 0.5}, 2);
  EXPECT_NEAR(Red(), 0.5F * before.At(10, 10), kOneReading);
  EXPECT_NEAR(Red(), 0.5F * before.At(10, 10), kOneReading);
  EXPECT_EQ(Red(), before.At(10, 10));
}

TEST_F(SceneCameraTest, TellsWhatThePinsDid) {
  std::vector<ExposedFrame> frames;
  camera_.OnExposed([&](const ExposedFrame& frame) { frames.push_back(frame); });
  SetOn(3, 1.0);
  SetOn(13, 0.5, milliseconds(10));
  camera_.Swap(3, 4);
  Frame();
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].request.number, 1);
  EXPECT_GT(frames[0].bytes, 64U * 48U * 2U);
  EXPECT_THAT(frames[0].shares,
              ::testing::ElementsAre(std::pair("channel 13", 0.25), std::pair("led-3", 1.0)));
}

TEST_F(SceneCameraTest, AnotherSceneIsSeenFromTheNextFrameOn) {
  WriteSmallScene(folder_.Path() / "next", /*ambient=*/0.3);
  std::promise<Status> read;
  ASSERT_TRUE(
      camera_.ChangeScene(folder_.Path() / "next", [&](const Status& s) { read.set_value(s); }));
  EXPECT_NEAR(Red(), 0.3, kOneReading);  // waits until it is read
  EXPECT_TRUE(read.get_future().get());

  WriteSmallScene(folder_.Path() / "bad");
  std::filesystem::remove(folder_.Path() / "bad/frames/dark.exr");
  std::promise<Status> failed;
  ASSERT_TRUE(
      camera_.ChangeScene(folder_.Path() / "bad", [&](const Status& s) { failed.set_value(s); }));
  EXPECT_EQ(failed.get_future().get().error().code, ErrorCode::kIo);
  EXPECT_NEAR(Red(), 0.3, kOneReading);  // the former one stays

  WriteSmallScene(folder_.Path() / "other", 0.0, [](Session& s, Rig& rig) {
    rig.lights.pop_back();
    s.frames.erase(s.frames.begin() + 9);
  });
  const Status other = camera_.ChangeScene(folder_.Path() / "other", [](const Status&) {});
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().message, HasSubstr("need a scene of the same rig"));
}

TEST_F(SceneCameraTest, WithoutAmbientLightThereCannotBeMoreOfIt) {
  LitScene scene = SmallScene();
  scene.ambient = Image<float>(kSmallPx);
  SceneCamera camera(std::move(scene), Sensor(), log_);
  EXPECT_TRUE(camera.SetAmbient(0.0));
  EXPECT_TRUE(camera.SetAmbient(1.0));
  const Status more = camera.SetAmbient(2.0);
  ASSERT_FALSE(more);
  EXPECT_THAT(more.error().message, HasSubstr("render the scene with illumination.ambient_rgb"));
}

}  // namespace
}  // namespace sateen::testing::lit_scene_test
