#include "scanner/capture/frame_plan.h"

#include <gmock/gmock.h>

#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::frame_plan_test {
namespace {

using ::testing::ElementsAre;

Rig TwoLights() {
  Rig rig = testing::FourLights();
  rig.lights.resize(2);
  return rig;
}

std::vector<std::string> NamesOf(const FramePlan& plan) {
  std::vector<std::string> names;
  for (const SessionFrame& frame : plan) {
    names.push_back(fmt::format("{} {:g}", NameOf(frame), *frame.exposure_s));
  }
  return names;
}

TEST(PlanOf, HasTheDarkAtTheLongestExposureAndTheFirstLightAgain) {
  EXPECT_THAT(NamesOf(PlanOf(TwoLights(), {0.01, 0.08})),
              ElementsAre("dark 0.08", "east 0.01", "east 0.08", "west 0.01", "west 0.08",
                          "east again 0.01", "dark 0.08"));
}

TEST(IsPlanOf, KnowsThePlanAndNothingElse) {
  const FramePlan plan = PlanOf(TwoLights(), {0.01, 0.08});
  EXPECT_TRUE(IsPlanOf(TwoLights(), plan));
  EXPECT_FALSE(IsPlanOf(testing::FourLights(), plan));
  FramePlan other = plan;
  other.back().exposure_s = 0.01;
  EXPECT_FALSE(IsPlanOf(TwoLights(), other));
  EXPECT_FALSE(IsPlanOf(TwoLights(), {}));
}

TEST(IsFirstExposure, TellsALightsFirstFrame) {
  const FramePlan plan = PlanOf(TwoLights(), {0.01, 0.08});
  std::vector<bool> first;
  for (size_t frame = 0; frame < plan.size(); ++frame) {
    first.push_back(IsFirstExposure(plan, frame));
  }
  EXPECT_THAT(first, ElementsAre(true, true, false, true, false, true, true));
}

TEST(FramePlan, FindsLightsAndNamesFiles) {
  const Rig rig = testing::FourLights();
  EXPECT_EQ(LightOf(rig, {.light = "north"}), 2U);
  EXPECT_EQ(LightOf(rig, {.role = FrameRole::kDark}), std::nullopt);
  EXPECT_EQ(FileNameOf(3, {.light = "led 2/b"}, "DSC_0007.NEF"), "frames/03-led_2_b.nef");
  EXPECT_EQ(FileNameOf(11, {.role = FrameRole::kRepeat, .light = "east"}, "a.dng"),
            "frames/11-east-again.dng");
  EXPECT_EQ(FileNameOf(0, {.role = FrameRole::kDark}, "a.dng"), "frames/00-dark.dng");
}

}  // namespace
}  // namespace sateen::frame_plan_test
