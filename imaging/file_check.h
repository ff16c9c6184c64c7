#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/error.h"

namespace sateen {

struct FileHead {
  std::string bytes;        // the first 16, or all if there are fewer
  uint64_t file_bytes = 0;  // length of the whole file
};

// No lossless coder in use here packs better than about 1 : 1000 but DWA, whose runs of equal
// blocks are deflated again; a header that asks for more than this is wrong.
inline constexpr uint64_t kMaxCompression = 1 << 14;

// Errors   kIo: the file is absent, a folder or unreadable
//          kBadData: it is empty
[[nodiscard]] Result<FileHead> ReadFileHead(const std::filesystem::path& path);

// Returns true for the first bytes of a TIFF file; DNG, NEF, CR2, ARW and PEF are TIFF too.
[[nodiscard]] bool IsTiffHead(const std::string& bytes);

// The next two find files that were cut short in ways their decoders let pass: libpng takes a
// PNG without its end mark, and LibRaw gives zeros for tiles that a lossless DNG has lost.

// Fails with kBadData unless the chunks of the PNG reach to its end mark.
[[nodiscard]] Status CheckPngIsWhole(const std::filesystem::path& path);
// Fails with kBadData unless every value, strip and tile of the TIFF's directories lies inside the
// file, and the directories list as many tiles as their pictures have.
[[nodiscard]] Status CheckTiffIsWhole(const std::filesystem::path& path);

}  // namespace sateen
