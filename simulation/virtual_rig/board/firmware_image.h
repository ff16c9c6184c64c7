#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/error.h"

namespace sateen {

// Reads the flash image of a firmware file, ELF or Intel HEX, as avrdude would burn it from address
// 0. Fails with kIo if the file cannot be read, with kBadData if it is neither or is larger than
// `flash_bytes`.
[[nodiscard]] Result<std::vector<uint8_t>> ReadFirmwareImage(const std::filesystem::path& path,
                                                             size_t flash_bytes);

}  // namespace sateen
