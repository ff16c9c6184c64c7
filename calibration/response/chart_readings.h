#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sateen {

// Sites of the sensor in the middle of one patch, in one order for all frames.
struct PatchSites {
  std::vector<uint8_t> colour;  // 0 red, 1 green, 2 blue
  std::vector<uint8_t> block;   // part of the patch, of kPatchBlocks x kPatchBlocks
};

inline constexpr int kPatchBlocks = 8;

// Readings of one frame in all patches.
struct ChartFrame {
  std::string file;             // name for messages
  std::optional<size_t> light;  // nothing: a dark frame
  double exposure_s = 0.0;
  std::vector<std::vector<uint16_t>> dn;  // [patch][site]
};

// RAW readings of a neutral chart under several lights and exposures.
struct ChartReadings {
  std::vector<std::string> lights;  // names
  std::vector<std::string> patch_names;
  std::vector<Eigen::Vector3d> reflectance_rgb;  // [patch]
  std::vector<PatchSites> patches;
  std::vector<ChartFrame> frames;
  double file_black_dn = 0.0;  // levels that the files state
  double file_white_dn = 0.0;
};

// Readings of one patch and colour in one lit frame, less those of the dark frames.
struct PatchSample {
  size_t frame = 0;
  size_t light = 0;
  size_t patch = 0;
  size_t colour = 0;
  double exposure_s = 0.0;
  double signal_dn = 0.0;  // mean
  double sd_dn = 0.0;      // standard deviation of that mean
  double top_dn = 0.0;     // highest site, as it reads
  double black_dn = 0.0;   // dark level that was subtracted
};

// Dark level: mean over the patches, extrapolated to no exposure time.
struct DarkLevel {
  double black_dn = 0.0;
  bool is_cut = false;  // a tenth of the dark sites or more read 0: lower values are lost
};

/// Returns the samples of all lit frames, in the order of the frames. The dark level of each patch
/// and colour is a line over exposure time where dark frames of several times exist, else their
/// mean. There is at least one dark frame.
[[nodiscard]] std::vector<PatchSample> SamplesOf(const ChartReadings& readings, DarkLevel& dark);

/// Returns how far a patch is from one even grey: the largest difference between one of its parts
/// and a plane through all, less five standard deviations of a part, relative to their mean; at
/// least 0.
[[nodiscard]] double UnevennessOf(const PatchSites& sites, const std::vector<uint16_t>& dn,
                                  double black_dn);

}  // namespace sateen
