#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sateen {

// A setting that a camera needs before a capture, or what to tell a person where it cannot be set.
struct RequiredSetting {
  std::vector<std::string> names;   // libgphoto2's, the first that the camera has
  std::vector<std::string> values;  // any of these; the first that the camera offers is set
  std::string what;                 // "RAW files": what it is for
  std::string remedy;               // on the camera itself
};

// How libgphoto2 names the settings of one family of cameras, the best name first.
struct CameraProfile {
  std::string name;
  std::vector<std::string> manufacturers;  // beginnings, any case; empty: every other camera
  std::vector<std::string> exposure_time;
  std::vector<std::string> f_number;
  std::vector<std::string> iso;
  std::vector<RequiredSetting> required;
};

// Returns the profile for what the camera says of itself; "generic" if no other fits.
[[nodiscard]] const CameraProfile& ProfileFor(std::string_view manufacturer);

// Returns the number that a camera's word for a setting means: "1/60", "0.0166s", "13/10", "f/8",
// "5.6", "400". Returns nothing for "bulb", "Auto" and the like.
[[nodiscard]] std::optional<double> SettingValue(std::string_view word);

// One setting of a camera is taken for another where they differ by less than this, relatively: a
// camera rounds 1/60 s to 0.0166 s, and its steps are 26 % or more, a third of a stop.
inline constexpr double kSameSetting = 0.04;
[[nodiscard]] bool IsSameSetting(double a, double b);

}  // namespace sateen
