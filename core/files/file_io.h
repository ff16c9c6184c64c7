#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "core/error.h"

namespace sateen {

// Records: a rig of 500 lights with a field each is as long, and a hostile one of this length parses
// in 250 MB.
inline constexpr uint64_t kMaxTextBytes = uint64_t{8} << 20;

// Hands the file's bytes to `use`, piece by piece. Errors as InputFile::Open().
[[nodiscard]] Status ReadPieces(const std::filesystem::path& path,
                                const std::function<void(std::string_view)>& use);

// Reads the file's bytes. Errors as InputFile::Open(); kBadData if there are more than `max_bytes`.
[[nodiscard]] Result<std::string> ReadFileBytes(const std::filesystem::path& path,
                                                uint64_t max_bytes = kMaxTextBytes);

// Creates or empties `path` and writes `bytes`. Errors speak of `shown`, the name that the user
// knows. To replace a file that counts, use core/files/output_folder.h.
[[nodiscard]] Status WriteBytes(const std::filesystem::path& path, const std::string& bytes,
                                const std::filesystem::path& shown);

// Makes what was written to a file or folder survive a loss of power.
[[nodiscard]] Status FlushToDisk(const std::filesystem::path& path,
                                 const std::filesystem::path& shown);

// Returns the system's words for an errno.
[[nodiscard]] std::string SystemReason(int error_number);

// Returns what to do about an errno of creating something in a folder, to end a message with.
[[nodiscard]] std::string FolderAdvice(int error_number);

}  // namespace sateen
