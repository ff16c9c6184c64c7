#pragma once

#include <cstdint>
#include <string>

#include "core/error.h"
#include "core/files/input_file.h"

namespace sateen {

// No lossless coder in use here packs better than about 1 : 1000 but DWA, whose runs of equal
// blocks are deflated again; a header that asks for more than this is wrong.
inline constexpr uint64_t kMaxCompression = 1 << 14;

// Returns the first 16 bytes, or all if there are fewer. kBadData where there are none.
[[nodiscard]] Result<std::string> ReadHead(const InputFile& file);

// Returns true for the first bytes of a TIFF file; DNG, NEF, CR2, ARW and PEF are TIFF too.
[[nodiscard]] bool IsTiffHead(const std::string& bytes);

// The next two find files that were cut short in ways their decoders let pass: libpng takes a
// PNG without its end mark, and LibRaw gives zeros for tiles that a lossless DNG has lost.

// Fails with kBadData unless the chunks of the PNG reach to its end mark.
[[nodiscard]] Status CheckPngIsWhole(const InputFile& file);
// Fails with kBadData unless every value, strip and tile of the TIFF's directories lies inside the
// file, and the directories list as many tiles as their pictures have; also where there are more
// entries or values than any camera writes, so that the cost is bounded.
[[nodiscard]] Status CheckTiffIsWhole(const InputFile& file);

}  // namespace sateen
