#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

// Name of a staging folder (OwnFolder), but for its random end.
inline constexpr std::string_view kStagingPrefix = ".sateen-";

/// Files in a staging folder that take the places of those in a folder, all of them or none.
///
///     STAGING/NAME             a new file, flushed to the disk
///     STAGING/.exchange        the new files, from before the first of them moves until all have
///     STAGING/.replaced/NAME   a former file, once it has moved aside
///
/// The last of `names` is the record, which describes the others: it leaves first and arrives last.
struct FileExchange {
  std::filesystem::path staging;
  std::filesystem::path dir;
  std::vector<std::string> names;
  std::vector<std::string> retired;  // former files that go without a new one

  /// Fails with kIo, which names the file. Then all is as before, or the message says where the
  /// former files are, and `keeps_former` is set: `staging` must stay for UndoExchange().
  [[nodiscard]] Status Run(const std::vector<std::filesystem::path>& folders,
                           bool& keeps_former) const;
};

// Outcome of an exchange that was cut short: the process was killed, or the disk failed.
struct ExchangeUndone {
  std::size_t back = 0;                     // former files that are in their places again
  std::vector<std::filesystem::path> kept;  // former files whose places are taken, in `staging`
};

// Undoes the exchange in `staging` if it was begun and is not complete. New files that came to
// their places go; what else is there by now stays.
[[nodiscard]] ExchangeUndone UndoExchange(const std::filesystem::path& staging,
                                          const std::filesystem::path& dir);

// Removes the staging folders that killed runs left in `dir`, and puts back the files that one of
// them had moved aside; a notice says so. Notices name, too, what may be such a folder and cannot be
// known to be one.
void CleanUpAfterKills(const std::filesystem::path& dir);

// Flushes the folders that can be read; others cannot be flushed either.
[[nodiscard]] Status FlushFolders(const std::vector<std::filesystem::path>& folders);

}  // namespace sateen
