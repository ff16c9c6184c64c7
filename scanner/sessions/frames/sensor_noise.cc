#include "scanner/sessions/frames/sensor_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <future>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "calibration/response/photon_transfer.h"
#include "core/statistics.h"
#include "imaging/raw.h"
#include "scanner/sessions/frames/frame_loader.h"

namespace sateen {
namespace {

constexpr int kTileWidth = 32;  // sites; even, as the pattern of colours is
constexpr int kTileHeight = 16;
constexpr size_t kSitesOfTile =
    kTileWidth * kTileHeight / 4;       // sites of one place in the 2x2 pattern
constexpr int kTileRows = 64;           // rows of tiles that are looked at
constexpr double kLeastTexture = 1e-9;  // share of the sum's squares below which there is no slope
constexpr size_t kGroups = 16;          // groups of about equally bright tiles per colour
constexpr size_t kTilesOfGroup = 4;     // tiles per group, at least
constexpr double kHighestShare = 0.9;   // share of the white level up to which readings are linear
// Times the variance that noise has by what most groups say.
constexpr double kMovedVariance = 1.5;
// Standard deviations by which the groups lie off a line of gain and read noise. A picture that
// moved as a whole by 0.2 pixels is off by 3, noise by 1.
constexpr double kMostMisfit = 2.0;
// A median says as much as the mean of this share of the values.
constexpr double kMedianWorth = 0.64;

// Noise of one site of the 2x2 pattern in a tile.
struct TileNoise {
  double mean_dn = 0.0;
  double variance_dn2 = 0.0;
};

// Returns (1) for one site of the pattern; nothing where a reading is cut off at either end.
std::optional<TileNoise> NoiseOfTile(const RawReadings& a, const RawReadings& b, int left, int top,
                                     size_t site) {
  const auto black = static_cast<double>(a.black[site]);
  const auto highest =
      static_cast<uint16_t>(black + kHighestShare * (static_cast<double>(a.white) - black));
  double count = 0.0;
  double sum = 0.0;
  double difference = 0.0;
  double sum_squares = 0.0;
  double difference_squares = 0.0;
  double products = 0.0;
  for (int y = top + static_cast<int>(site / 2); y < top + kTileHeight; y += 2) {
    const std::span<const uint16_t> row_a = a.Row(y);
    const std::span<const uint16_t> row_b = b.Row(y);
    for (int x = left + static_cast<int>(site % 2); x < left + kTileWidth; x += 2) {
      const uint16_t of_a = row_a[static_cast<size_t>(x)];
      const uint16_t of_b = row_b[static_cast<size_t>(x)];
      if (std::min(of_a, of_b) == 0 || std::max(of_a, of_b) >= highest) {
        return std::nullopt;
      }
      const double s = of_a + of_b - 2.0 * black;
      const double d = of_a - of_b;
      count += 1.0;
      sum += s;
      difference += d;
      sum_squares += s * s;
      difference_squares += d * d;
      products += s * d;
    }
  }
  const double of_sum = sum_squares - sum * sum / count;
  const double shared = products - sum * difference / count;
  const double of_difference = difference_squares - difference * difference / count;
  const double slope = of_sum > kLeastTexture * sum_squares ? shared / of_sum : 0.0;
  return TileNoise{.mean_dn = 0.5 * sum / count,
                   .variance_dn2 = 0.5 * (of_difference - slope * shared) / (count - 2.0)};
}

std::array<std::vector<TileNoise>, 3> NoiseOfTiles(const RawReadings& a, const RawReadings& b) {
  std::array<std::vector<TileNoise>, 3> tiles;
  const int columns = a.size_px.width / kTileWidth;
  const int rows = a.size_px.height / kTileHeight;
  const int looked_at = std::min(rows, kTileRows);
  for (int j = 0; j < looked_at; ++j) {
    for (int column = 0; column < columns; ++column) {
      for (size_t site = 0; site < 4; ++site) {
        if (const std::optional<TileNoise> tile =
                NoiseOfTile(a, b, column * kTileWidth, j * rows / looked_at * kTileHeight, site)) {
          tiles[a.cfa[site]].push_back(*tile);
        }
      }
    }
  }
  return tiles;
}

// Adds the median tile of each group of about equally bright ones.
void AddGroups(std::vector<TileNoise> tiles, size_t colour, bool is_dark,
               std::vector<TransferPoint>& points) {
  std::ranges::sort(tiles, {}, &TileNoise::mean_dn);
  const size_t groups =
      is_dark ? std::min<size_t>(1, tiles.size()) : std::min(kGroups, tiles.size() / kTilesOfGroup);
  for (size_t g = 0; g < groups; ++g) {
    const size_t begin = g * tiles.size() / groups;
    const std::span<TileNoise> group(tiles.data() + begin, (g + 1) * tiles.size() / groups - begin);
    const auto middle = group.begin() + static_cast<std::ptrdiff_t>(group.size() / 2);
    const double mean = middle->mean_dn;
    std::ranges::nth_element(group, middle, {}, &TileNoise::variance_dn2);
    const auto sites = static_cast<double>(kSitesOfTile * group.size());
    points.push_back({.mean_dn = is_dark ? 0.0 : mean,
                      .variance_dn2 = middle->variance_dn2,
                      .count = kMedianWorth * sites,
                      .colour = colour,
                      .is_dark = is_dark});
  }
}

// Erases lit groups with far more noise than most: there the cloth or a shadow moved.
void LeaveOutWhatMoved(std::vector<TransferPoint>& points) {
  double least = std::numeric_limits<double>::infinity();
  for (const TransferPoint& point : points) {
    least = std::min(least, point.variance_dn2);
  }
  std::vector<double> gains;
  for (const TransferPoint& point : points) {
    if (!point.is_dark && point.mean_dn > 0.0) {
      gains.push_back((point.variance_dn2 - least) / point.mean_dn);
    }
  }
  if (gains.empty()) {
    return;
  }
  const double gain = Median(std::move(gains));
  std::erase_if(points, [&](const TransferPoint& point) {
    return !point.is_dark && point.variance_dn2 > kMovedVariance * (gain * point.mean_dn + least);
  });
}

Result<std::vector<TransferPoint>> PointsOf(const FrameFile& first, const FrameFile& again,
                                            bool is_dark) {
  std::vector<TransferPoint> points;
  const auto compare = [&](const RawReadings& a, const RawReadings& b) {
    const std::array<std::vector<TileNoise>, 3> tiles = NoiseOfTiles(a, b);
    for (size_t c = 0; c < 3; ++c) {
      AddGroups(tiles[c], c, is_dark, points);
    }
    return Status();
  };
  const auto take_first = [&](const RawReadings& a) {
    const auto take_again = [&](const RawReadings& b) { return compare(a, b); };
    return TakeRawReadings(again.path, take_again, {.size_px = a.size_px});
  };
  const Status read = TakeRawReadings(first.path, take_first, first.limit);
  return read.map([&] { return std::move(points); });
}

Result<SensorNoise> MeasureNoise(const RepeatedLight& repeated, const std::vector<FrameFile>& dark,
                                 const Task& task) {
  const Result<std::string> hash = CheckedHash(repeated.again);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  const bool has_dark_pair = dark.size() >= 2 && dark.front().exposure == dark.back().exposure;
  std::future<Result<std::vector<TransferPoint>>> of_dark;
  if (has_dark_pair) {
    of_dark = std::async(task.ThreadCount() > 1 ? std::launch::async : std::launch::deferred,
                         [&] { return PointsOf(dark.front(), dark.back(), true); });
  }
  Result<std::vector<TransferPoint>> points = PointsOf(repeated.first, repeated.again, false);
  const Result<std::vector<TransferPoint>> dark_points =
      has_dark_pair ? of_dark.get() : Result<std::vector<TransferPoint>>();
  if (!points || !dark_points) {
    return tl::unexpected(points ? dark_points.error() : points.error());
  }
  points->insert(points->end(), dark_points->begin(), dark_points->end());
  if (has_dark_pair) {
    LeaveOutWhatMoved(*points);
  }
  return FitPhotonTransfer(*std::move(points), has_dark_pair)
      .and_then([&](const PhotonTransfer& transfer) -> Result<SensorNoise> {
        if (transfer.misfit > kMostMisfit) {
          return Fail(ErrorCode::kDegenerate, "the pair differs by more than noise");
        }
        return SensorNoise{.gain_dn = transfer.gain_dn_per_electron,
                           .read_dn = transfer.read_noise_dn,
                           .source = repeated.again.path.string(),
                           .sha256_of_input = {{repeated.again.path.string(), *hash}}};
      });
}

}  // namespace

Result<std::optional<SensorNoise>> FindSensorNoise(const ReadPlan& plan, const Task& task) {
  const std::optional<Response>& response = plan.rig.response;
  if (response && response->gain_dn_per_electron && response->read_noise_dn) {
    return SensorNoise{.gain_dn = *response->gain_dn_per_electron,
                       .read_dn = *response->read_noise_dn,
                       .source = "the rig"};
  }
  if (!plan.repeated) {
    return std::nullopt;
  }
  const Result<SensorNoise> measured = MeasureNoise(*plan.repeated, plan.dark, task);
  if (!measured && measured.error().code != ErrorCode::kDegenerate) {
    return tl::unexpected(measured.error());
  }
  return measured ? std::optional(*measured) : std::nullopt;
}

}  // namespace sateen
