#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "imaging/picture_limit.h"
#include "rig/rig.h"
#include "scanner/sessions/session.h"
#include "scanner/sessions/truth.h"

namespace sateen {

// File of one exposure to be read.
struct FrameFile {
  std::filesystem::path path;
  // The file's value divided by this is radiance: exposure_s (iso / 100) / f_number^2.
  double exposure = 1.0;
  std::optional<std::string> sha256;  // as the session recorded it
  // Response of the rig's sensor, by which readings become balanced radiance.
  std::optional<Response> response = std::nullopt;
  // Shift of its picture from the first light's frame: a point at x there is at x + shift_px here.
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  // Bounds of its picture, by which it is refused before its pixels are decoded.
  PictureLimit limit = {};
};

// Lit frames of one light: one, or several with different exposures, the longest first.
using LightFiles = std::vector<FrameFile>;

// A light's frame, and its repeat at the end of a capture.
struct RepeatedLight {
  FrameFile first;
  FrameFile again;
};

// Files and facts of a dataset, as its layout gives them, before any pixel is read.
struct ReadPlan {
  std::string layout;
  Rig rig;
  std::vector<LightFiles> lit;  // [light of the rig]; empty where the session has no frame of it
  std::vector<FrameFile> dark;
  std::optional<RepeatedLight> repeated;  // with one exposure
  std::optional<std::filesystem::path> mask;
  bool mask_is_shared = false;  // from one folder up: not used where its size differs
  std::optional<TruthFiles> truth;
  std::optional<Session> session;
  std::vector<std::string> warnings;
  std::map<std::string, std::string> sha256_of_input;  // path as read -> hash
};

}  // namespace sateen
