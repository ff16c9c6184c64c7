#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image_io.h"
#include "imaging/light_stack.h"
#include "rig/rig.h"
#include "scanner/sessions/frames/mosaic_loader.h"
#include "scanner/sessions/session.h"
#include "scanner/sessions/truth.h"

namespace sateen {

// How frames are read: colours interpolated at every pixel, or readings of the mosaic.
enum class Domain {
  kRgb,  // LightStack
  kRaw,  // LoadedMosaics, or an error
  kAuto  // LoadedMosaics where the frames allow it
};

// A session, or photographs in a public layout, read into values: what the solver needs, and where
// it came from.
struct Dataset {
  std::string layout;  // "session", "diligent", "lp", "lights.txt", "photographs"
  LightStack stack;    // K frames, all of one size; empty where there are mosaics
  std::optional<LoadedMosaics> mosaics;
  std::string why_no_mosaics;  // reason that Domain::kAuto found no mosaics
  Rig rig;                     // K lights in the order of the frames; camera where known
  std::optional<Mask> mask;    // the part of the image that counts; at least one pixel
  std::optional<Truth> truth;
  std::optional<Session> session;  // the whole record, also of lights that were not asked for
  std::vector<std::string> warnings;
  std::map<std::string, std::string> sha256_of_input;  // path as read -> hash

  [[nodiscard]] ImageSize Size() const {
    return mosaics ? mosaics->stack.size_px : stack[0].rgb.Size();
  }
  [[nodiscard]] const std::string& FirstName() const {
    return mosaics ? mosaics->stack.lit[0].name : stack[0].name;
  }
};

struct ReadDatasetOptions {
  // Use only these lights, in this order, by their index from 0 in the dataset; empty: all.
  std::vector<int> lights = {};
  // Use these instead of what the dataset names. The rig has one light for each of the dataset's,
  // in the same order; those of a session are matched by name.
  std::optional<std::filesystem::path> rig_file = std::nullopt;
  std::optional<std::filesystem::path> mask_file = std::nullopt;
  // A simulated session whose truth is this dataset's too, in place of what lies beside it.
  std::optional<std::filesystem::path> truth_dir = std::nullopt;
  // Takes all photographs of a folder that is no session, one per light. The lights'
  // directions are not known yet (docs/calibration.md, Chrome spheres).
  bool lights_unknown = false;
  Encoding encoding = Encoding::kAuto;
  Domain domain = Domain::kRgb;
  // Whether mosaics are weighed by the sensor's noise, so that FindSensorNoise() is asked.
  bool by_noise = true;
  std::filesystem::path scratch_dir = {};  // LoadMosaics()
  // Pixels of the first frame in place of the bound by its bytes (imaging/picture_limit.h). The
  // others must have its size.
  std::optional<int64_t> max_pixels = std::nullopt;
};

/// Reads a dataset as it is: a folder with session.json (docs/formats.md), a DiLiGenT folder, an
/// RTI .lp file, a folder of images with a lights.txt in it or one folder up, or, with a rig file,
/// a folder of images alone. Where a folder could be several of these, the first counts.
///
/// Errors   kInvalidArgument: a light that `options` asks for does not exist, or is asked for twice
///          kIo: a file is absent or unreadable
///          kBadData: Domain::kRaw of a dataset that has no mosaics; wrong counts, sizes or
///          formats; a light of zero length; a hash that differs
///          kCancelled
[[nodiscard]] Result<Dataset> ReadDataset(const std::filesystem::path& path,
                                          const ReadDatasetOptions& options, const Task& task = {});

}  // namespace sateen
