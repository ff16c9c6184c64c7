#include "core/files/file_io.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "core/files/input_file.h"

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
  const Result<InputFile> file = InputFile::Open(path);
  if (!file) {
    return tl::unexpected(file.error());
  }
  std::string piece(kPieceBytes, '\0');
  for (uint64_t offset = 0;;) {
    const Result<size_t> count = file->ReadAt(offset, piece);
    if (!count) {
      return tl::unexpected(count.error());
    }
    use(std::string_view(piece).substr(0, *count));
    if (*count < piece.size()) {
      return {};
    }
    offset += *count;
  }
}

Result<std::string> ReadFileBytes(const std::filesystem::path& path, uint64_t max_bytes) {
  const Result<InputFile> file = InputFile::Open(path);
  if (!file) {
    return tl::unexpected(file.error());
  }
  // Files under /proc say 0 and hold more.
  std::string bytes(std::min(std::max(file->Bytes(), uint64_t{kPieceBytes}), max_bytes) + 1, '\0');
  const Result<size_t> count = file->ReadAt(0, bytes);
  if (!count) {
    return tl::unexpected(count.error());
  }
  if (*count > max_bytes || file->Bytes() > max_bytes) {
    return Fail(ErrorCode::kBadData,
                "{}: is too long: it has {} bytes, and at most {} are read of a file of this kind; "
                "is it the right file?",
                path.string(), std::max(file->Bytes(), uint64_t{*count}), max_bytes);
  }
  bytes.resize(*count);
  return bytes;
}

}  // namespace sateen
