#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// Known answers beside a capture.
struct Truth {
  Image3 normal;                 // x right, y up, z to the viewer; zero where unknown
  std::optional<Image3> albedo;  // simulated sessions only
  std::string source;            // the file of the normals
};

struct TruthFiles {
  std::filesystem::path normal;
  std::optional<std::filesystem::path> albedo;
};

// Finds normal_gt.exr, else Normal_gt.mat, in a folder of a public data set.
[[nodiscard]] std::optional<TruthFiles> FindPublicTruth(const std::filesystem::path& dir);

// Finds truth/normal.exr and truth/albedo.exr in the folder of a simulated session.
[[nodiscard]] std::optional<TruthFiles> FindSessionTruth(const std::filesystem::path& dir);

/// Reads normals (an image, or a MATLAB file with the H x W x 3 doubles `Normal_gt`) and albedo.
/// Adds the files' hashes to `sha256_of_input`.
///
/// Errors   kIo: a file is absent or unreadable
///          kBadData: of another size than `size_px`, or a normal neither zero nor of unit length
[[nodiscard]] Result<Truth> ReadTruth(const TruthFiles& files, ImageSize size_px,
                                      std::map<std::string, std::string>& sha256_of_input);

}  // namespace sateen
