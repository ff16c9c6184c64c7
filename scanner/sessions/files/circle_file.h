#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "calibration/spheres/sphere_search.h"
#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

inline constexpr size_t kMaxCircles = 16;  // as --spheres

// Reads the outlines of spheres as a person marked them: a line "x y radius" for each, in pixels,
// centres at integers from 0, y down; or, with one number per line, x, y and radius in turn,
// 1-based and y up (circle_data.txt of PSBox). kBadData where it is neither, there are more than
// kMaxCircles, or a circle has its centre outside of the picture or is wider than it.
[[nodiscard]] Result<std::vector<Circle>> ReadCircles(
    const std::filesystem::path& path, ImageSize size,
    std::map<std::string, std::string>& sha256_of_input);

}  // namespace sateen
