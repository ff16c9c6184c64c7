#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"

namespace sateen {

// Findings about a session on disk.
struct SessionProof {
  int files = 0;  // files that are as they were captured
  std::vector<std::string>
      faults;  // one sentence each, with what to do; empty: the session is whole
};

/// Proves a session on disk whole:
///
/// * session.json, journal and rig agree
/// * each light has its frame
/// * each file has the hash that was recorded
/// * frames and mask lie in the session's folder, in a capture the rig too: a whole can be moved
///
/// A session whose session.json names no journal, and that has none, was not made by a capture and
/// is proved by what it records.
///
/// Errors   kIo: there is no such folder; kCancelled
[[nodiscard]] Result<SessionProof> ProveSession(const std::filesystem::path& dir, const Task& task);

// Fails unless the session is whole: kBadData with all faults, one per line. Returns how many files
// were hashed.
[[nodiscard]] Result<int> VerifySession(const std::filesystem::path& dir, const Task& task);

}  // namespace sateen
