#include "pipelines/solve/mosaic_maps.h"

#include <algorithm>
#include <future>
#include <utility>
#include <vector>

#include "imaging/raw.h"

namespace sateen {
namespace {

constexpr int kRowsAtOnce = 256;  // even, so that every band begins with the same colours
// Pixels per band: its maps and what waits to be written take some 100 bytes per pixel.
constexpr int kPixelsOfBand = 1 << 20;

Image3 ColoursOf(const MosaicStack& stack, size_t frame, int begin, int end) {
  std::vector<uint16_t> buffer;
  const std::span<const uint16_t> readings = stack.rows->Read(frame, begin, end, buffer);
  RawMosaic mosaic{.samples = Image<float>(stack.size_px.width, end - begin), .cfa = stack.cfa};
  const MosaicFrame& levels = stack.lit[frame];
  for (size_t p = 0; p < readings.size(); ++p) {
    const size_t x = p % static_cast<size_t>(stack.size_px.width);
    const size_t y = p / static_cast<size_t>(stack.size_px.width);
    const size_t site = y % 2 * 2 + x % 2;
    mosaic.samples.pixels[p] =
        levels.per_dn[site] * static_cast<float>(readings[p]) + levels.at_zero[site];
  }
  return Demosaic(mosaic);
}

Image3 ThumbnailOf(const MosaicStack& stack, size_t frame) {
  Thumbnail small(stack.size_px, kOverviewPanelWidthPx, 3);
  const int height = stack.size_px.height;
  for (int begin = 0; begin + 1 < height; begin += kRowsAtOnce) {
    // A last row by itself would be no mosaic.
    const int end = begin + kRowsAtOnce + 1 >= height ? height : begin + kRowsAtOnce;
    small.Add(begin, ColoursOf(stack, frame, begin, end).planes, nullptr);
    if (end == height) {
      break;
    }
  }
  return small.Means();
}

}  // namespace

LightFrame ShowFrame(const MosaicStack& stack, size_t frame) {
  return {.rgb = ColoursOf(stack, frame, 0, stack.size_px.height), .name = stack.lit[frame].name};
}

Result<SolveSummary> SolveIntoMaps(const MosaicStack& stack, const Rig& rig,
                                   const std::optional<Mask>& mask, const MosaicOptions& options,
                                   const MapsFacts& facts, const Task& task, OutputFolder& folder) {
  std::future<Image3> first_frame =
      std::async(std::launch::async, [&stack] { return ThumbnailOf(stack, 0); });
  MosaicOptions by_bands = options;
  by_bands.band_rows = std::clamp(kPixelsOfBand / stack.size_px.width, 16, kRowsAtOnce);
  Result<MapsWriter> writer = MapsWriter::Begin(stack.size_px, facts, /*has_error=*/false, folder);
  Result<SolveSummary> summary =
      writer ? SolveMosaicByBands(
                   stack, rig, mask, by_bands, task,
                   [&](int /*first_row*/, const NormalField& band) { return writer->Add(band); })
             : tl::unexpected(writer.error());
  const Image3 shown = first_frame.get();
  if (!summary) {
    return summary;
  }
  return writer->Finish(shown, folder).map([&] { return *std::move(summary); });
}

}  // namespace sateen
