#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// One photograph of a board: a file, or the lit frames of a session of kind `board`.
struct BoardPhoto {
  std::string name;  // within the folder, for messages
  std::vector<FrameFile> files;
};

struct BoardFolder {
  std::vector<BoardPhoto> photos;                      // in natural order of their names
  std::vector<std::string> ignored;                    // other files there, with the reason
  std::map<std::string, std::string> sha256_of_input;  // hashes of the sessions' records
};

/// Lists the photographs of a board at a path: a photograph; a session of kind `board`; or a folder
/// of photographs (JPEG, PNG, TIFF, TGA, EXR, camera RAW) and of such sessions. A session is one
/// photograph. The rig that it names is not read.
///
/// Errors   kIo: the path is absent or cannot be listed
///          kBadData: nothing of a board there; a session, asked for by its own path, of another
///          kind or without lit frames
[[nodiscard]] Result<BoardFolder> ListBoardPhotos(const std::filesystem::path& path);

// A board's picture to find corners in.
struct BoardPicture {
  Image<uint8_t> grey;
  std::map<std::string, std::string> sha256_of_input;
};

/// Reads the grey levels of one photograph: those of an 8-bit file as they are; otherwise linear
/// light, the mean of the session's lit frames, with its 99.5th percentile as white and the curve
/// of sRGB. Corners do not move under any curve.
///
/// Errors   kIo, kBadData: as ReadPhoto(), ReadRawMosaic(); a recorded hash that differs; frames of
///          different sizes; no light in the picture
[[nodiscard]] Result<BoardPicture> ReadBoardPicture(const BoardPhoto& photo);

}  // namespace sateen
