#include "scanner/devices/camera_profiles.h"

#include <gmock/gmock.h>

namespace sateen::camera_profiles_test {
namespace {

TEST(CameraProfiles, EachFamilyIsFoundByItsMaker) {
  EXPECT_EQ(ProfileFor("Nikon Corporation").name, "nikon");
  EXPECT_EQ(ProfileFor("NIKON").name, "nikon");
  EXPECT_EQ(ProfileFor("Canon Inc.").name, "canon-eos");
  EXPECT_EQ(ProfileFor("Panasonic").name, "generic");
  EXPECT_EQ(ProfileFor("").name, "generic");
}

TEST(CameraProfiles, WordsOfAllFamiliesAreRead) {
  EXPECT_DOUBLE_EQ(SettingValue("1/60").value(), 1.0 / 60.0);
  EXPECT_DOUBLE_EQ(SettingValue("13/10").value(), 1.3);
  EXPECT_DOUBLE_EQ(SettingValue("0.0166s").value(), 0.0166);
  EXPECT_DOUBLE_EQ(SettingValue("0.3").value(), 0.3);
  EXPECT_DOUBLE_EQ(SettingValue("30").value(), 30.0);
  EXPECT_DOUBLE_EQ(SettingValue("f/8").value(), 8.0);
  EXPECT_DOUBLE_EQ(SettingValue("6400").value(), 6400.0);
  for (const char* word :
       {"", "bulb", "Bulb", "Auto", "1/", "/60", "1/0", "-1", "f/", "s", "nan", "1/60x", "Time"}) {
    EXPECT_FALSE(SettingValue(word)) << word;
  }
}

// The steps of cameras are a third of a stop, 1.26; roundings up to 2.4 % (1/125 s: 1/128 s).
TEST(CameraProfiles, RoundingIsTheSameAndAStepIsNot) {
  EXPECT_TRUE(IsSameSetting(1.0 / 60.0, 0.0166));
  EXPECT_TRUE(IsSameSetting(1.0 / 125.0, 1.0 / 128.0));
  EXPECT_FALSE(IsSameSetting(0.1, 0.08));
  EXPECT_FALSE(IsSameSetting(0.08, 0.1));
  EXPECT_FALSE(IsSameSetting(100.0, 125.0));
}

}  // namespace
}  // namespace sateen::camera_profiles_test
