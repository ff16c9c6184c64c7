#include "simulation/virtual_rig/board/firmware_image.h"

#include <fmt/format.h>
#include <simavr/sim_elf.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>

#include "core/files/file_io.h"

namespace sateen {
namespace {

// The linker script of avr-gcc puts flash at 0 and RAM and EEPROM far above it; the loader copies
// .text and the initial values of .data, and that is what libsimavr returns as `flash`.
Result<std::vector<uint8_t>> ReadElf(const std::string& path) {
  elf_firmware_t image = {};
  const bool read = elf_read_firmware(path.c_str(), &image) == 0 && image.flash != nullptr;
  std::vector<uint8_t> flash;
  if (read) {
    flash.assign(image.flash, image.flash + image.flashsize);
  }
  std::free(image.flash);
  std::free(image.eeprom);
  for (uint32_t i = 0; i < image.symbolcount; ++i) {
    std::free(image.symbol[i]);
  }
  std::free(static_cast<void*>(image.symbol));
  if (!read) {
    return Fail(ErrorCode::kBadData,
                "{}: is an ELF file but no firmware for an AVR; build one: make firmware", path);
  }
  return flash;
}

int HexDigit(char c) {
  if (c >= '0' && c <= '9') {
    return c - '0';
  }
  const char upper = static_cast<char>(c & ~0x20);
  return upper >= 'A' && upper <= 'F' ? upper - 'A' + 10 : -1;
}

// Returns the bytes of ":10010000214601360121470136007EFE09D2190140", or none if it is no such
// record or its sum is wrong.
std::vector<uint8_t> DecodeRecord(std::string_view line) {
  if (line.size() < 11 || line[0] != ':' || line.size() % 2 == 0) {
    return {};
  }
  std::vector<uint8_t> bytes;
  uint8_t sum = 0;
  for (size_t i = 1; i < line.size(); i += 2) {
    const int high = HexDigit(line[i]);
    const int low = HexDigit(line[i + 1]);
    if (high < 0 || low < 0) {
      return {};
    }
    bytes.push_back(static_cast<uint8_t>(high << 4 | low));
    sum = static_cast<uint8_t>(sum + bytes.back());
  }
  return sum == 0 && bytes.size() == size_t{bytes[0]} + 5 ? bytes : std::vector<uint8_t>();
}

// Reads Intel HEX with 16-bit addresses, which reach all of 32 KiB. Type 0 is data, 1 the end; 3
// and 5 name a start address, which an AVR does not have.
Result<std::vector<uint8_t>> ReadHex(std::string_view text, const std::string& path) {
  std::vector<uint8_t> flash;
  for (int number = 1; !text.empty(); ++number) {
    const size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text = end == std::string_view::npos ? "" : text.substr(end + 1);
    if (!line.empty() && line.back() == '\r') {
      line.remove_suffix(1);
    }
    const std::vector<uint8_t> record = DecodeRecord(line);
    if (record.empty() || (record[3] != 0 && record[3] != 1 && record[3] != 3 && record[3] != 5)) {
      return Fail(ErrorCode::kBadData,
                  "{}: line {} is no Intel HEX record for 64 KiB of flash; need a firmware image: "
                  "make firmware",
                  path, number);
    }
    if (record[3] == 1) {
      return flash;
    }
    if (record[3] == 0) {
      const size_t address = size_t{record[1]} << 8 | record[2];
      flash.resize(std::max(flash.size(), address + record[0]), 0xFF);
      std::copy(record.begin() + 4, record.end() - 1,
                flash.begin() + static_cast<std::ptrdiff_t>(address));
    }
  }
  return Fail(ErrorCode::kBadData, "{}: ends before its end record; copy or build it again", path);
}

}  // namespace

Result<std::vector<uint8_t>> ReadFirmwareImage(const std::filesystem::path& path,
                                               size_t flash_bytes) {
  const Result<std::string> bytes = ReadFileBytes(path);
  if (!bytes) {
    return tl::unexpected(bytes.error());
  }
  const bool elf = bytes->starts_with(
      "\x7f"
      "ELF");
  Result<std::vector<uint8_t>> flash =
      elf ? ReadElf(path.string()) : ReadHex(*bytes, path.string());
  if (flash && flash->size() > flash_bytes) {
    return Fail(ErrorCode::kBadData, "{}: has {} bytes; the chip holds {}", path.string(),
                flash->size(), flash_bytes);
  }
  return flash;
}

}  // namespace sateen
