#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "calibration/print/board_find.h"
#include "core/error.h"
#include "core/task.h"
#include "scanner/sessions/board_photos.h"

namespace sateen {

// A photograph without a board that counts, and why.
struct RejectedPhoto {
  std::string name;
  std::string reason;
};

struct FoundBoards {
  ImageSize size_px;               // size of all views
  std::vector<BoardView> views;    // in the order of the photographs
  std::vector<BoardPhoto> photos;  // photographs of the views
  std::vector<RejectedPhoto> rejected;
  std::vector<std::string> ignored;  // files there that are no photographs
  std::map<std::string, std::string> sha256_of_input;
};

/// Reads the photographs of ListBoardPhotos() and finds the board in each, on all threads of
/// `task`; memory for one photograph per thread. Rejected are files that cannot be read, pictures
/// of another size than most, and those where FindBoard() finds no such board.
///
/// Errors   as ListBoardPhotos(); kDegenerate: the board is in none of the photographs; kCancelled
[[nodiscard]] Result<FoundBoards> FindBoards(const std::filesystem::path& path,
                                             const BoardSpec& spec, const Task& task = {});

}  // namespace sateen
