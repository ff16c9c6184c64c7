#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sateen {

// The sites of the sensor in the middle of one patch, in one order for all frames.
struct PatchSites {
  std::vector<uint8_t> colour;  // 0 red, 1 green, 2 blue
  std::vector<uint8_t> block;   // which of kPatchBlocks x kPatchBlocks parts of the patch
};

inline constexpr int kPatchBlocks = 8;

// What one frame reads there.
struct ChartFrame {
  std::string file;             // for messages
  std::optional<size_t> light;  // nothing: a dark frame
  double exposure_s = 0.0;
  std::vector<std::vector<uint16_t>> dn;  // [patch][site]
};

// A neutral chart under several lights and exposures, as RAW readings.
struct ChartReadings {
  std::vector<std::string> lights;  // names
  std::vector<std::string> patch_names;
  std::vector<Eigen::Vector3d> reflectance_rgb;  // of the patches
  std::vector<PatchSites> patches;
  std::vector<ChartFrame> frames;
  double file_black_dn = 0.0;  // as the files say
  double file_white_dn = 0.0;
};

// One patch and colour in one lit frame: readings above the dark frames' there.
struct PatchSample {
  size_t frame = 0;
  size_t light = 0;
  size_t patch = 0;
  size_t colour = 0;
  double exposure_s = 0.0;
  double signal_dn = 0.0;  // mean
  double sd_dn = 0.0;      // of that mean
  double top_dn = 0.0;     // the highest site, as it reads
  double black_dn = 0.0;   // what was taken off
};

// The level of the dark: mean over the patches, no light, no time. [DN]
struct DarkLevel {
  double black_dn = 0.0;
  bool is_cut = false;  // a tenth of the dark sites or more read 0: what lies below is lost
};

/// The samples of all lit frames, in the order of the frames. Dark readings of each patch and colour
/// are a line over exposure time, where dark frames of several times are there, else their mean.
/// There is at least one dark frame.
[[nodiscard]] std::vector<PatchSample> SamplesOf(const ChartReadings& readings, DarkLevel& dark);

/// How much a patch is not one even grey: the largest difference of its parts from a plane through
/// them, relative to their mean, less five standard deviations of one part; 0 or more.
[[nodiscard]] double UnevennessOf(const PatchSites& sites, const std::vector<uint16_t>& dn,
                                  double black_dn);

}  // namespace sateen
