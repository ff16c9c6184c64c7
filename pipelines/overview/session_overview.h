#pragma once

#include <filesystem>

#include "core/error.h"
#include "core/task.h"

namespace sateen {

struct SessionOverviewOptions {
  std::filesystem::path session;
  std::filesystem::path maps;    // of a solve of the session; empty: frames alone
  std::filesystem::path output;  // PNG
};

/// Writes all frames of a session, and the maps of its solve, as one picture.
///
/// Errors   kInvalidArgument: the output is no .png
///          kBadData: the maps are of another session, or of another shape than the frames
///          kIo: a file cannot be read or written
///          kCancelled
[[nodiscard]] Status WriteSessionOverview(const SessionOverviewOptions& options,
                                          const Task& task = {});

}  // namespace sateen
