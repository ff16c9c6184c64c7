#include "core/file_io.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

namespace sateen {
namespace {

constexpr size_t kPieceBytes = size_t{1} << 20;

class FileDescriptor {
 public:
  FileDescriptor(const std::filesystem::path& path, int flags)
      : fd_(open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  ~FileDescriptor() {
    if (fd_ >= 0) {
      close(fd_);
    }
  }
  [[nodiscard]] int Get() const { return fd_; }
  // Closing can be the first to tell that bytes were lost (NFS, quotas).
  [[nodiscard]] bool Close() { return close(std::exchange(fd_, -1)) == 0; }

 private:
  int fd_;
};

tl::unexpected<Error> CannotWrite(const std::filesystem::path& path, int error_number) {
  return Fail(ErrorCode::kIo, "{}: cannot write: {}", path.string(), SystemReason(error_number));
}

}  // namespace

std::string SystemReason(int error_number) { return std::generic_category().message(error_number); }

std::string FolderAdvice(int error_number) {
  switch (error_number) {
    case EACCES:
    case EPERM:
      return "; get write permission or choose another folder";
    case EROFS:
      return "; choose a folder on a disk that can be written to";
    case ENOSPC:
    case EDQUOT:
      return "; free some space or choose another disk";
    case ENOENT:
      return "; create the folder first";
    default:
      return "; choose another folder";
  }
}

Status WriteBytes(const std::filesystem::path& path, const std::string& bytes,
                  const std::filesystem::path& shown) {
  FileDescriptor file(path, O_WRONLY | O_CREAT | O_TRUNC);
  if (file.Get() < 0) {
    return CannotWrite(shown, errno);
  }
  for (size_t written = 0; written < bytes.size();) {
    const ssize_t count = write(file.Get(), bytes.data() + written, bytes.size() - written);
    if (count < 0 && errno != EINTR) {
      return CannotWrite(shown, errno);
    }
    written += count > 0 ? static_cast<size_t>(count) : 0;
  }
  if (!file.Close()) {
    return CannotWrite(shown, errno);
  }
  return {};
}

Status FlushToDisk(const std::filesystem::path& path, const std::filesystem::path& shown) {
  const FileDescriptor file(path, O_RDONLY);
  // EINVAL: a file system that has nothing to flush.
  if (file.Get() < 0 || (fsync(file.Get()) != 0 && errno != EINVAL)) {
    return Fail(ErrorCode::kIo, "{}: cannot flush to disk: {}", shown.string(),
                SystemReason(errno));
  }
  return {};
}

Status ReadPieces(const std::filesystem::path& path,
                  const std::function<void(std::string_view)>& use) {
  const FileDescriptor file(path, O_RDONLY);
  if (file.Get() < 0) {
    return Fail(ErrorCode::kIo, "{}: cannot read: {}", path.string(), SystemReason(errno));
  }
  std::string piece(kPieceBytes, '\0');
  while (true) {
    const ssize_t count = read(file.Get(), piece.data(), piece.size());
    if (count == 0) {
      return {};
    }
    if (count > 0) {
      use(std::string_view(piece).substr(0, static_cast<size_t>(count)));
    } else if (errno != EINTR) {
      return Fail(ErrorCode::kIo, "{}: cannot read: {}", path.string(), SystemReason(errno));
    }
  }
}

Result<std::string> ReadFileBytes(const std::filesystem::path& path) {
  std::string bytes;
  if (Status read = ReadPieces(path, [&](std::string_view piece) { bytes += piece; }); !read) {
    return tl::unexpected(read.error());
  }
  return bytes;
}

}  // namespace sateen
