#include "core/files/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "core/files/file_io.h"

namespace sateen {
namespace {

tl::unexpected<Error> CannotRead(const std::filesystem::path& path, int error_number) {
  switch (error_number) {
    case ENOENT:
    case ENOTDIR:
      return Fail(ErrorCode::kIo, "{}: no such file", path.string());
    case EACCES:
      return Fail(ErrorCode::kIo, "{}: cannot read: {}; get permission to read it", path.string(),
                  SystemReason(error_number));
    case ELOOP:
      return Fail(ErrorCode::kIo, "{}: cannot read: its links lead in a circle; name a file",
                  path.string());
    default:
      return Fail(ErrorCode::kIo, "{}: cannot read: {}", path.string(), SystemReason(error_number));
  }
}

Status CheckRegular(const std::filesystem::path& path, mode_t mode) {
  if (S_ISREG(mode)) {
    return {};
  }
  if (S_ISDIR(mode)) {
    return Fail(ErrorCode::kIo, "{}: is a folder; need a file", path.string());
  }
  return Fail(ErrorCode::kIo, "{}: is a {}; need a file: save the data to one first", path.string(),
              S_ISFIFO(mode)   ? "pipe"
              : S_ISSOCK(mode) ? "socket"
                               : "device");
}

}  // namespace

InputFile::InputFile(std::filesystem::path path, int fd, uint64_t bytes)
    : path_(std::move(path)), fd_(fd), bytes_(bytes) {}

InputFile::InputFile(InputFile&& other) noexcept
    : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)), bytes_(other.bytes_) {}

InputFile::~InputFile() {
  if (fd_ >= 0) {
    close(fd_);
  }
}

Result<InputFile> InputFile::Open(const std::filesystem::path& path) {
  struct stat found = {};
  // Looks before it opens: opening alone makes some devices act.
  if (stat(path.c_str(), &found) != 0) {
    return CannotRead(path, errno);
  }
  if (Status regular = CheckRegular(path, found.st_mode); !regular) {
    return tl::unexpected(regular.error());
  }
  const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
  if (fd < 0) {
    return CannotRead(path, errno);
  }
  InputFile file(path, fd, 0);
  if (fstat(fd, &found) != 0) {
    return CannotRead(path, errno);
  }
  if (Status regular = CheckRegular(path, found.st_mode); !regular) {
    return tl::unexpected(regular.error());
  }
  file.bytes_ = static_cast<uint64_t>(found.st_size);
  return file;
}

std::string InputFile::LibraryName() const { return fmt::format("/proc/self/fd/{}", fd_); }

Result<size_t> InputFile::ReadAt(uint64_t offset, std::span<char> to) const {
  size_t done = 0;
  while (done < to.size()) {
    const ssize_t count =
        pread(fd_, to.data() + done, to.size() - done, static_cast<off_t>(offset + done));
    if (count == 0) {
      break;
    }
    if (count > 0) {
      done += static_cast<size_t>(count);
    } else if (errno != EINTR) {
      return CannotRead(path_, errno);
    }
  }
  return done;
}

}  // namespace sateen
