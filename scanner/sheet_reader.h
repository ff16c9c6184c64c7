#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calibration/light_fit.h"
#include "core/error.h"
#include "core/task.h"
#include "rig/rig.h"
#include "scanner/block_means.h"

namespace sateen {

struct ReadSheetOptions {
  // The rough rig in place of the one that the session names; lights are matched by name.
  std::optional<std::filesystem::path> rig_file = std::nullopt;
  BlockGrid grid = {};
};

// A session of white paper: for each light of the rig what the sheet shows of it.
struct Sheet {
  Rig rig;  // rough
  Eigen::Isometry3d table_from_sheet = Eigen::Isometry3d::Identity();
  BlockGrid grid;
  std::vector<std::vector<SheetSample>> samples;  // [light][block that can be used, row by row]
  std::vector<std::vector<int>> blocks;           // [light]: which block each sample is
  std::vector<std::string> warnings;
  std::map<std::string, std::string> sha256_of_input;
};

/// Reads a sheet session frame by frame: memory for one frame a thread. The sheet lies where
/// `table_from_sheet` of the session says, or on the table.
///
/// Errors   kIo, kBadData: as ReadCapture(); the session is of another kind; the rig has no camera; a
///          light without a frame; a frame that is saturated or dark over more than half of the sheet
///          kCancelled
[[nodiscard]] Result<Sheet> ReadSheet(const std::filesystem::path& dir,
                                      const ReadSheetOptions& options, const Task& task = {});

}  // namespace sateen
