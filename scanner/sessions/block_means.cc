#include "scanner/sessions/block_means.h"

#include <array>
#include <limits>

#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "scanner/sessions/frames/frame_loader.h"
#include "scanner/sessions/frames/sensor_reading.h"

namespace sateen {
namespace {

constexpr float kSaturationLevel = 0.98F;  // share of what saturates
constexpr int kFewestSites = 4;            // sites along each side of a block

// Sums over one block, for each colour.
struct BlockSums {
  std::array<double, 3> value = {};
  std::array<double, 3> difference2 =
      {};  // squared differences of horizontal neighbours of one colour
  std::array<double, 3> count = {};
  std::array<double, 3> pairs = {};
  bool saturated = false;

  void Add(size_t colour, float value_here, float saturation) {
    value[colour] += static_cast<double>(value_here);
    count[colour] += 1.0;
    saturated = saturated || value_here >= saturation;
  }
  void AddPair(size_t colour, float left, float right) {
    const double difference = static_cast<double>(right) - static_cast<double>(left);
    difference2[colour] += difference * difference;
    pairs[colour] += 1.0;
  }
  [[nodiscard]] BlockMean Mean(double exposure) const {
    BlockMean mean{.saturated = saturated};
    for (size_t c = 0; c < 3; ++c) {
      const auto i = static_cast<Eigen::Index>(c);
      mean.radiance_rgb[i] = value[c] / count[c] / exposure;
      mean.site_variance_rgb[i] = 0.5 * difference2[c] / pairs[c] / (exposure * exposure);
      mean.sites_rgb[i] = count[c];
    }
    return mean;
  }
};

// Rows or columns of a block.
struct Span {
  int begin;
  int end;
};

Span SpanOf(int block, int blocks, int sites) {
  return {static_cast<int>(static_cast<int64_t>(block) * sites / blocks),
          static_cast<int>(static_cast<int64_t>(block + 1) * sites / blocks)};
}

BlockMean MeanOfMosaic(const RawMosaic& mosaic, const SensorReading& reading, Span columns,
                       Span rows, double exposure) {
  BlockSums sums;
  for (int y = rows.begin; y < rows.end; ++y) {
    for (int x = columns.begin; x < columns.end; ++x) {
      const size_t colour = mosaic.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)];
      const float value = reading.Value(mosaic.samples.At(x, y), colour);
      sums.Add(colour, value, kSaturationLevel * reading.Value(reading.saturation, colour));
      if (x + 2 < columns.end) {
        sums.AddPair(colour, value, reading.Value(mosaic.samples.At(x + 2, y), colour));
      }
    }
  }
  return sums.Mean(exposure);
}

BlockMean MeanOfPhoto(const Photo& photo, const SensorReading& reading, Span columns, Span rows,
                      double exposure) {
  BlockSums sums;
  for (size_t c = 0; c < 3; ++c) {
    const float saturation = photo.saturation
                                 ? kSaturationLevel * reading.Value(*photo.saturation, c)
                                 : std::numeric_limits<float>::infinity();
    for (int y = rows.begin; y < rows.end; ++y) {
      for (int x = columns.begin; x < columns.end; ++x) {
        const float value = reading.Value(photo.rgb[c].At(x, y), c);
        sums.Add(c, value, saturation);
        if (x + 1 < columns.end) {
          sums.AddPair(c, value, reading.Value(photo.rgb[c].At(x + 1, y), c));
        }
      }
    }
  }
  return sums.Mean(exposure);
}

template <typename MeanOf>
Result<BlockMeans> Divide(const FrameFile& file, ImageSize size_px, const BlockGrid& grid,
                          const MeanOf& mean_of) {
  if (size_px.width < kFewestSites * grid.columns || size_px.height < kFewestSites * grid.rows) {
    return Fail(ErrorCode::kBadData, "{}: is {} x {} px; need at least {} x {} for {} x {} blocks",
                file.path.string(), size_px.width, size_px.height, kFewestSites * grid.columns,
                kFewestSites * grid.rows, grid.columns, grid.rows);
  }
  BlockMeans means{.size_px = size_px, .grid = grid};
  means.blocks.reserve(static_cast<size_t>(grid.columns) * static_cast<size_t>(grid.rows));
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      means.blocks.push_back(mean_of(SpanOf(column, grid.columns, size_px.width),
                                     SpanOf(row, grid.rows, size_px.height)));
    }
  }
  return means;
}

}  // namespace

Eigen::AlignedBox2d BlockMeans::Extent(int column, int row) const {
  const Span x = SpanOf(column, grid.columns, size_px.width);
  const Span y = SpanOf(row, grid.rows, size_px.height);
  return {Eigen::Vector2d(x.begin, y.begin), Eigen::Vector2d(x.end - 1, y.end - 1)};
}

Eigen::Vector2d BlockMeans::Center(int column, int row) const {
  return Extent(column, row).center();
}

Result<BlockMeans> BlockMeansOf(const FrameFile& file, const RawMosaic& mosaic,
                                const SensorReading& reading, const BlockGrid& grid) {
  return Divide(file, mosaic.samples.Size(), grid,
                [&](Span columns, Span rows) {
                  return MeanOfMosaic(mosaic, reading, columns, rows, file.exposure);
                })
      .map([&](BlockMeans divided) {
        divided.exposure_s = mosaic.exposure_s;
        return divided;
      });
}

Result<BlockMeans> BlockMeansOf(const FrameFile& file, const Photo& photo, const BlockGrid& grid) {
  return Divide(file, photo.rgb.Size(), grid, [&](Span columns, Span rows) {
    return MeanOfPhoto(photo, ReadingOf(file), columns, rows, file.exposure);
  });
}

Result<BlockMeans> ReadBlockMeans(const FrameFile& file, const BlockGrid& grid) {
  Result<std::string> hash = CheckedHash(file);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  Result<BlockMeans> means =
      IsRawName(file.path)
          ? ReadRawMosaic(file.path, file.limit).and_then([&](const RawMosaic& mosaic) {
              return ReadingOf(file, mosaic).and_then([&](const SensorReading& reading) {
                return BlockMeansOf(file, mosaic, reading, grid);
              });
            })
          : ReadPhoto(file.path, Encoding::kAuto, file.limit).and_then([&](const Photo& photo) {
              return BlockMeansOf(file, photo, grid);
            });
  if (means) {
    means->sha256 = *std::move(hash);
  }
  return means;
}

}  // namespace sateen
