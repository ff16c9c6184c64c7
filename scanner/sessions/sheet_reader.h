#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calibration/lights/light_fit.h"
#include "calibration/sheet/sheet_pose.h"
#include "core/error.h"
#include "core/task.h"
#include "rig/rig.h"
#include "scanner/sessions/block_means.h"
#include "targets/sheet_border.h"

namespace sateen {

struct ReadSheetOptions {
  // The rough rig in place of the one that the session names; lights are matched by name.
  std::optional<std::filesystem::path> rig_file = std::nullopt;
  BlockGrid grid = {};
  // Border printed on the sheet. Where `table_from_sheet` is not recorded it is found by the
  // border. Samples are taken from the blank inside alone.
  std::optional<SheetBorder> border = std::nullopt;
  bool find_poses = false;  // by the border, also where they are recorded
  // A frame that is dark or saturated over more than half of the sheet, or missing, leaves its
  // light without samples, with the reason in Sheet::faults, in place of an error.
  bool allow_bad_frames = false;
};

// A session of white paper: for each light of the rig what the sheet shows of it.
struct Sheet {
  Rig rig;  // rough
  Eigen::Isometry3d table_from_sheet = Eigen::Isometry3d::Identity();
  bool pose_is_recorded = false;        // else taken to lie on the table, or:
  std::optional<SheetPose> found_pose;  // by its border
  BlockGrid grid;
  int blank_blocks = 0;  // blocks of the grid that lie inside the border; without one, all
  std::vector<std::vector<SheetSample>> samples;  // [light][block that can be used, row by row]
  std::vector<std::vector<int>> blocks;           // [light]: which block each sample is
  std::vector<FrameFault> faults;                 // [light]: kNone, or why it has no samples
  std::optional<Eigen::Vector3d> dark_rgb;        // mean radiance of the dark frames
  std::vector<std::string> warnings;
  std::map<std::string, std::string> sha256_of_input;
};

/// Reads a sheet session frame by frame: memory for one frame per thread. The sheet lies where
/// `table_from_sheet` of the session says, or where its border is seen, or on the table.
///
/// Where a light has several exposures, each block is taken from the longest that is not saturated
/// there: paper is bright, so the others would add little. shift_px of a frame is left aside: a
/// block is tens of pixels wide and paper has no texture, so that a pixel moves its mean by less
/// than 1e-3 of what neighbouring blocks differ by.
///
/// Errors   kIo, kBadData: as ReadDataset(); the session is of another kind; the rig has no camera;
///          a light without a frame; a frame that is saturated or dark over more than half of the
///          sheet
///          kDegenerate: as FitSheetPose(), with the session's folder; kCancelled
[[nodiscard]] Result<Sheet> ReadSheet(const std::filesystem::path& dir,
                                      const ReadSheetOptions& options, const Task& task = {});

}  // namespace sateen
