#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "calibration/lights/light_fit.h"
#include "rig/rig.h"
#include "scanner/sessions/block_means.h"
#include "targets/sheet_border.h"

namespace sateen {

// A block of one frame, less the dark, and what is wrong with it.
struct BlockSample {
  SheetSample sample;
  bool is_lit = false;
  bool saturated = false;
};

/// Returns each block's sample of the light. `dark`: the mean of the dark frames, or nothing.
///
///     sd^2 = (median over blocks of variance / radiance) radiance / sites         each colour
[[nodiscard]] std::vector<BlockSample> BlockSamplesOf(const BlockMeans& means,
                                                      const std::vector<Eigen::Vector3d>& dark);

// Where the centre of each block lies on the sheet; nothing where it is not to be used.
using Places = std::vector<std::optional<Eigen::Vector3d>>;

// A block counts where it shows nothing but the blank inside of the border; without one, anywhere.
[[nodiscard]] Places PlacesOf(const BlockMeans& means, const Camera& camera,
                              const Eigen::Isometry3d& table_from_sheet,
                              const std::optional<SheetBorder>& border);

// Shares of the blocks that can be used.
struct Spoilt {
  double saturated = 0.0;
  double unlit = 0.0;

  // Returns the fault that more than half of the blocks have.
  [[nodiscard]] FrameFault Fault() const;
};

[[nodiscard]] Spoilt SpoiltOf(const std::vector<BlockSample>& blocks, const Places& places);

}  // namespace sateen
