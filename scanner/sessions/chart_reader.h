#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calibration/response/chart.h"
#include "calibration/response/chart_find.h"
#include "calibration/response/chart_readings.h"
#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "rig/rig.h"

namespace sateen {

struct ReadChartOptions {
  // In place of the rig that the session names; lights are matched by name.
  std::optional<std::filesystem::path> rig_file = std::nullopt;
  FindChartOptions find = {};
};

// A session of a neutral chart: where its patches are, and what every frame reads there.
struct ChartSession {
  Rig rig;
  ChartPose pose;
  ChartReadings readings;
  // The frame in which the chart was found, as one brightness for 2 x 2 sites, black = 0, white =
  // 1, and the corners, in its cells, of what is read of each patch. To be looked at.
  Image<float> cells;
  std::vector<std::vector<Eigen::Vector2d>> corners;
  std::map<std::string, std::string> sha256_of_input;
};

/// Reads a session of kind chart. Unlike in other sessions a light may have any number of lit
/// frames, each with its exposure_s, and there may be any number of dark ones; the order is that of
/// the record. The chart is looked for in the brightest frame whose brightest parts are not
/// saturated; the middle 60 % of each patch, along each side, are read. Memory: two bytes per
/// site that is read.
///
/// Errors   kIo, kBadData: as ReadDataset(); the session is of another kind; the rig has no camera;
///          a frame is no camera RAW file, has no exposure_s, or another aperture, ISO, size,
///          pattern or levels than the first; the chart is not found, or a patch is too small to be
///          read
///          kCancelled
[[nodiscard]] Result<ChartSession> ReadChart(const std::filesystem::path& dir, const Chart& chart,
                                             const ReadChartOptions& options,
                                             const Task& task = {});

}  // namespace sateen
