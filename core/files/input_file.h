#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "core/error.h"

namespace sateen {

/// A file that a person, a record or a client named, opened for reading without trust in the name.
///
/// Only regular files open, through any number of links. Opening never waits: not for the writer of
/// a pipe, not for a device. Every reader of this project opens its input here, so that a name
/// that stands for something else fails at once and with one set of words.
///
/// Errors   kIo: absent, a folder, a pipe, a socket, a device, a loop of links, or unreadable
class InputFile {
 public:
  [[nodiscard]] static Result<InputFile> Open(const std::filesystem::path& path);

  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  ~InputFile();

  // Returns the name that the user knows.
  [[nodiscard]] const std::filesystem::path& Path() const { return path_; }
  // Returns the length when the file was opened.
  [[nodiscard]] uint64_t Bytes() const { return bytes_; }
  // Returns a name by which a library opens this very file, whatever has taken its place since.
  // Valid as long as this object is.
  [[nodiscard]] std::string LibraryName() const;
  // Reads `to.size()` bytes from `offset`, or fewer at the end of the file; returns how many.
  [[nodiscard]] Result<size_t> ReadAt(uint64_t offset, std::span<char> to) const;

 private:
  InputFile(std::filesystem::path path, int fd, uint64_t bytes);

  std::filesystem::path path_;
  int fd_;  // -1 once moved from
  uint64_t bytes_;
};

}  // namespace sateen
