#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/error.h"

namespace sateen {

// The flash image of a firmware file, ELF or Intel HEX: what avrdude would burn, from address 0.
// kIo where the file cannot be read, kBadData where it is neither or is larger than `flash_bytes`.
[[nodiscard]] Result<std::vector<uint8_t>> ReadFirmwareImage(const std::filesystem::path& path,
                                                             size_t flash_bytes);

}  // namespace sateen
