#pragma once

#include <initializer_list>
#include <string_view>

#include "core/error.h"

// Ranges of the numbers in a rig: wide enough for every rig that a person could build, from a
// microscope to a hall, and narrow enough that no arithmetic of ours leaves its numbers.
namespace sateen {

struct Plausible {
  double least;
  double most;
  const char* unit;  // " mm", or empty
};

inline constexpr Plausible kPlausibleFocal{0.1, 1e8, " px"};
inline constexpr Plausible kPlausiblePrincipal{-1e6, 1e6, " px"};
inline constexpr Plausible kPlausibleRadial{-1e6, 1e6, ""};  // long lenses have large k2 and k3
inline constexpr Plausible kPlausibleTangential{-1.0, 1.0, ""};
inline constexpr Plausible kPlausiblePlace{-1e7, 1e7, " mm"};   // along x and y of the table
inline constexpr Plausible kPlausibleHeight{1e-2, 1e7, " mm"};  // above the table
inline constexpr Plausible kPlausibleFlux{1e-36, 1e37, ""};     // in any unit
inline constexpr double kMostFluxRatio = 1e12;                  // of the lights of one rig
inline constexpr Plausible kPlausibleGain{1e-9, 1e9, ""};
inline constexpr Plausible kPlausibleWhite{1e-6, 1e9, " DN"};
inline constexpr Plausible kPlausibleNoise{0.0, 1e9, " DN"};
inline constexpr Plausible kPlausibleBalance{1e-3, 1e3, ""};
inline constexpr Plausible kPlausibleSpacing{1e-3, 1e7, " mm"};
inline constexpr Plausible kPlausibleSd{0.0, 1e7, " mm"};

// Fails with kBadData at the first value that is out of the range; NaN is:
// "rig.json: camera.k: fx is 1e+15; need 0.1 to 1e+08 px".
[[nodiscard]] Status CheckPlausible(std::string_view what, std::string_view name,
                                    std::initializer_list<double> values, const Plausible& range);

}  // namespace sateen
