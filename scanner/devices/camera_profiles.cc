#include "scanner/devices/camera_profiles.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

namespace sateen {
namespace {

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](unsigned char letter) {
    return static_cast<char>(std::tolower(letter));
  });
  return lower;
}

std::optional<double> Number(std::string_view text) {
  double value = 0.0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failed != std::errc() || end != text.data() + text.size() || !(value > 0.0)) {
    return std::nullopt;
  }
  return value;
}

const RequiredSetting kManualExposure = {.names = {"expprogram"},
                                         .values = {"M", "Manual"},
                                         .what = "manual exposure",
                                         .remedy = "turn the mode dial to M"};
const RequiredSetting kManualFocus = {.names = {"focusmode"},
                                      .values = {"Manual", "MF (fixed)", "MF (selection)", "MF"},
                                      .what = "manual focus",
                                      .remedy = "set lens and camera to manual focus"};

// Nikon: names and values as a D5100 gives them.
const std::array<CameraProfile, 3> kProfiles = {
    {{.name = "nikon",
      .manufacturers = {"nikon"},
      .exposure_time = {"shutterspeed2", "shutterspeed"},
      .f_number = {"f-number"},
      .iso = {"iso"},
      .required = {{.names = {"imagequality"},
                    .values = {"NEF (Raw)", "NEF", "RAW"},
                    .what = "RAW files, and nothing beside them",
                    .remedy = "set the image quality to NEF (RAW)"},
                   kManualExposure,
                   kManualFocus,
                   {.names = {"autoiso", "isoauto"},
                    .values = {"Off", "off"},
                    .what = "a fixed ISO",
                    .remedy = "turn automatic ISO off"},
                   {.names = {"capturetarget"},
                    .values = {"Memory card"},
                    .what = "frames on the card until they are on the computer",
                    .remedy = "put a card into the camera"}}},
     {.name = "canon-eos",
      .manufacturers = {"canon"},
      .exposure_time = {"shutterspeed"},
      .f_number = {"aperture"},
      .iso = {"iso"},
      .required = {{.names = {"imageformat"},
                    .values = {"RAW", "cRAW"},
                    .what = "RAW files, and nothing beside them",
                    .remedy = "set the image quality to RAW"},
                   {.names = {"autoexposuremode", "expprogram"},
                    .values = {"Manual", "M"},
                    .what = "manual exposure",
                    .remedy = "turn the mode dial to M"},
                   kManualFocus,
                   {.names = {"capturetarget"},
                    .values = {"Memory card"},
                    .what = "frames on the card until they are on the computer",
                    .remedy = "put a card into the camera"}}},
     // PTP has no word for RAW: the files themselves show it.
     {.name = "generic",
      .exposure_time = {"shutterspeed"},
      .f_number = {"f-number", "aperture"},
      .iso = {"iso"},
      .required = {kManualExposure, kManualFocus}}}};

}  // namespace

const CameraProfile& ProfileFor(std::string_view manufacturer) {
  const std::string lower = Lower(manufacturer);
  for (const CameraProfile& profile : kProfiles) {
    for (const std::string& beginning : profile.manufacturers) {
      if (lower.starts_with(beginning)) {
        return profile;
      }
    }
  }
  return kProfiles.back();
}

std::optional<double> SettingValue(std::string_view word) {
  if (word.starts_with("f/")) {
    word.remove_prefix(2);
  } else if (word.ends_with("s")) {
    word.remove_suffix(1);
  }
  const size_t slash = word.find('/');
  if (slash == std::string_view::npos) {
    return Number(word);
  }
  const auto above = Number(word.substr(0, slash));
  const auto below = Number(word.substr(slash + 1));
  return above && below ? std::optional(*above / *below) : std::nullopt;
}

bool IsSameSetting(double a, double b) { return std::abs(a - b) <= kSameSetting * std::max(a, b); }

}  // namespace sateen
