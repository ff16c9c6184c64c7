#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "scanner/sessions/frames/sensor_reading.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// How a frame is divided: into columns x rows of blocks of about one size.
struct BlockGrid {
  int columns = 96;
  int rows = 64;
};

struct BlockMean {
  Eigen::Vector3d radiance_rgb = Eigen::Vector3d::Zero();
  // Variance of one site, from how neighbours of one colour differ: a slope across the block is no
  // noise.
  Eigen::Vector3d site_variance_rgb = Eigen::Vector3d::Zero();
  Eigen::Vector3d sites_rgb = Eigen::Vector3d::Zero();  // how many sites of each colour
  bool saturated = false;                               // a site at or above 98 % of what saturates
};

// A frame as the means of its blocks, rows from the top: what a fit of smooth light needs of it.
struct BlockMeans {
  ImageSize size_px;  // size of the frame
  BlockGrid grid;
  std::vector<BlockMean> blocks;
  std::string sha256;
  std::optional<double> exposure_s;  // where a camera RAW file says it

  // The middle of a block, and its outermost pixels. [px]
  [[nodiscard]] Eigen::Vector2d Center(int column, int row) const;
  [[nodiscard]] Eigen::AlignedBox2d Extent(int column, int row) const;
};

/// Reads a frame of a session: camera RAW straight from the mosaic, each colour from its own sites,
/// or a linear image.
///
/// Errors   kIo, kBadData as ReadRawMosaic() and ReadPhoto(); the hash differs from the recorded
///          one; the frame has fewer than 4 x 4 sites per block
[[nodiscard]] Result<BlockMeans> ReadBlockMeans(const FrameFile& file, const BlockGrid& grid);

// The same of a frame that has been decoded; without a hash.
[[nodiscard]] Result<BlockMeans> BlockMeansOf(const FrameFile& file, const RawMosaic& mosaic,
                                              const SensorReading& reading, const BlockGrid& grid);
[[nodiscard]] Result<BlockMeans> BlockMeansOf(const FrameFile& file, const Photo& photo,
                                              const BlockGrid& grid);

}  // namespace sateen
