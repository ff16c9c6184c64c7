#pragma once

#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "imaging/image_io.h"
#include "scanner/sessions/dataset.h"
#include "solver/ladder.h"
#include "solver/lambertian.h"

namespace sateen {

// Direction of y in normal maps.
enum class NormalY {
  kUp,   // OpenGL, glTF
  kDown  // DirectX
};

// "up", "down".
[[nodiscard]] std::string_view Name(NormalY normal_y);

// "auto", "raw", "rgb".
[[nodiscard]] std::string_view Name(Domain domain);
// The mode's name, or "none".
[[nodiscard]] std::string_view Name(const std::optional<LadderMode>& robust);

struct SolveOptions {
  // Session folder, or another layout that ReadDataset() reads.
  std::filesystem::path capture;
  // Folder for the maps; created if missing. Not the capture's own.
  std::filesystem::path output;
  // Lights to use, by index from 0 in the capture; empty: all.
  std::vector<int> lights;
  // Files to use instead of the capture's own; empty: the capture's.
  std::filesystem::path rig_file;
  std::filesystem::path mask_file;
  // Simulated session whose truth the maps are compared with; empty: what lies beside the capture.
  std::filesystem::path truth_dir;
  Encoding encoding = Encoding::kAuto;
  // Pixels that the first frame may have whatever the length of its file, in millions.
  std::optional<int> max_megapixels;
  Domain domain = Domain::kAuto;
  // Rungs of the ladder; absent: least squares without weights and without uncertainty.
  std::optional<LadderMode> robust = LadderMode::kAuto;
  LambertianOptions least_squares;
  NormalY normal_y = NormalY::kUp;
  // Height of the surface above the table plane; at most a quarter of the lowest light's.
  double height_mm = 0.0;
  // Finds each pixel's height from the normals, and repeats the solve with it.
  bool relief = false;
  // Writes the maps as a camera without the lens's distortion would see them.
  bool undistort = false;
  // Largest mean angular error from truth that passes, in (0, 180]; the capture must have truth.
  std::optional<double> fail_above_deg;
};

}  // namespace sateen
