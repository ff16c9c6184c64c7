#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rig/rig.h"
#include "scanner/sessions/session.h"
#include "scanner/sessions/truth.h"

namespace sateen {

// One exposure to be read.
struct FrameFile {
  std::filesystem::path path;
  // The file's value divided by this is radiance: exposure_s (iso / 100) / f_number^2.
  double exposure = 1.0;
  std::optional<std::string> sha256;  // what the session recorded
  // Of the rig that the frame is read for: how its readings become balanced radiance.
  std::optional<Response> response = std::nullopt;
  // How its picture lies against that of the first light's frame: what is at x there is at x + shift.
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
};

// The lit frames of one light: one, or several of different exposures, the longest first.
using LightFiles = std::vector<FrameFile>;

// A light's frame, and the same once more at the end of a capture.
struct RepeatedLight {
  FrameFile first;
  FrameFile again;
};

// What a layout says about a dataset, before any pixel is read.
struct ReadPlan {
  std::string layout;
  Rig rig;
  std::vector<LightFiles> lit;  // [light of the rig]; empty where the session has no frame of it
  std::vector<FrameFile> dark;
  std::optional<RepeatedLight> repeated;  // with one exposure
  std::optional<std::filesystem::path> mask;
  bool mask_is_shared = false;  // it lies one folder up: left out where its size does not fit
  std::optional<TruthFiles> truth;
  std::optional<Session> session;
  std::vector<std::string> warnings;
  std::map<std::string, std::string> sha256_of_input;  // path as read -> hash
};

}  // namespace sateen
