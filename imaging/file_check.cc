#include "imaging/file_check.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

namespace sateen {
namespace {

constexpr size_t kHeadBytes = 16;

tl::unexpected<Error> CutShort(const std::filesystem::path& path, uint64_t file_bytes,
                               uint64_t needed_bytes) {
  return Fail(ErrorCode::kBadData,
              "{}: is cut short: it has {} bytes and needs at least {}; copy it again",
              path.string(), file_bytes, needed_bytes);
}

// Reads numbers at places of a file, either byte order; remembers how far the file would have to
// reach for all that was asked of it.
class FileProbe {
 public:
  FileProbe(const std::filesystem::path& path, uint64_t file_bytes)
      : stream_(path, std::ios::binary), file_bytes_(file_bytes) {}

  void SetBigEndian(bool big_endian) { big_endian_ = big_endian; }
  void Need(uint64_t offset, uint64_t count) {
    needed_bytes_ = std::max(needed_bytes_, offset + count);
  }
  // Reads an unsigned integer of `width` bytes; nothing if the file ends before it.
  std::optional<uint32_t> Read(uint64_t offset, size_t width) {
    Need(offset, width);
    unsigned char bytes[4] = {};
    if (offset + width > file_bytes_ || !stream_.seekg(static_cast<std::streamoff>(offset)) ||
        !stream_.read(reinterpret_cast<char*>(bytes), static_cast<std::streamsize>(width))) {
      return std::nullopt;
    }
    uint32_t value = 0;
    for (size_t i = 0; i < width; ++i) {
      value = value << 8 | bytes[big_endian_ ? i : width - 1 - i];
    }
    return value;
  }
  [[nodiscard]] uint64_t NeededBytes() const { return needed_bytes_; }

 private:
  std::ifstream stream_;
  uint64_t file_bytes_;
  uint64_t needed_bytes_ = 0;
  bool big_endian_ = true;
};

// Bytes of one value of each TIFF type (TIFF 6.0, section 2; 13 IFD is of a later supplement).
constexpr std::array<uint64_t, 14> kValueBytes = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4};

enum Tag : uint32_t {
  kImageWidth = 256,
  kImageLength = 257,
  kStripOffsets = 273,
  kStripByteCounts = 279,
  kTileWidth = 322,
  kTileLength = 323,
  kTileOffsets = 324,
  kTileByteCounts = 325,
  kSubDirectories = 330  // where DNG and NEF keep the full-size image
};

constexpr std::array<uint32_t, 9> kWalked = {kImageWidth,      kImageLength,    kStripOffsets,
                                             kStripByteCounts, kTileWidth,      kTileLength,
                                             kTileOffsets,     kTileByteCounts, kSubDirectories};

// Walks the directories of a TIFF file. The probe learns where their values, strips and tiles end.
class TiffWalk {
 public:
  explicit TiffWalk(FileProbe& probe) : probe_(probe) {}

  void Run() {
    pending_.push_back(probe_.Read(4, 4).value_or(0));
    while (!pending_.empty()) {
      const uint32_t offset = pending_.back();
      pending_.pop_back();
      if (offset != 0 && visited_.size() < kMaxDirectories && visited_.insert(offset).second) {
        VisitDirectory(offset);
      }
    }
  }
  // Tiles that the directories do not list.
  [[nodiscard]] uint64_t MissingTiles() const { return missing_tiles_; }

 private:
  static constexpr size_t kMaxDirectories = 64;
  static constexpr uint64_t kMaxValues = 1U << 20;
  using Fields = std::map<uint32_t, std::vector<uint32_t>>;

  void VisitDirectory(uint64_t offset) {
    const uint32_t entries = probe_.Read(offset, 2).value_or(0);
    Fields fields;
    for (uint32_t i = 0; i < entries; ++i) {
      const uint64_t entry = offset + 2 + uint64_t{12} * i;
      const uint32_t tag = probe_.Read(entry, 2).value_or(0);
      fields[tag] = Values(entry, std::ranges::find(kWalked, tag) != kWalked.end());
    }
    NeedPieces(fields[kStripOffsets], fields[kStripByteCounts]);
    NeedPieces(fields[kTileOffsets], fields[kTileByteCounts]);
    CountTiles(fields);
    std::ranges::copy(fields[kSubDirectories], std::back_inserter(pending_));
    pending_.push_back(probe_.Read(offset + 2 + uint64_t{12} * entries, 4).value_or(0));
  }

  void NeedPieces(const std::vector<uint32_t>& starts, const std::vector<uint32_t>& lengths) {
    for (size_t i = 0; i < std::min(starts.size(), lengths.size()); ++i) {
      probe_.Need(starts[i], lengths[i]);
    }
  }

  void CountTiles(Fields& fields) {
    const auto first = [&fields](Tag tag) -> uint64_t {
      return fields[tag].empty() ? 0 : fields[tag].front();
    };
    const uint64_t tile_width = first(kTileWidth);
    const uint64_t tile_length = first(kTileLength);
    if (tile_width == 0 || tile_length == 0) {
      return;
    }
    const uint64_t columns = (first(kImageWidth) + tile_width - 1) / tile_width;
    const uint64_t rows = (first(kImageLength) + tile_length - 1) / tile_length;
    missing_tiles_ += std::max<uint64_t>(columns * rows, fields[kTileOffsets].size()) -
                      fields[kTileOffsets].size();
  }

  // Returns the entry's values where they are `wanted` and SHORT, LONG or IFD. They are in the
  // entry itself if they fit.
  std::vector<uint32_t> Values(uint64_t entry, bool wanted) {
    const uint32_t type = probe_.Read(entry + 2, 2).value_or(0);
    const uint64_t count = probe_.Read(entry + 4, 4).value_or(0);
    const uint64_t width = type < kValueBytes.size() ? kValueBytes[type] : 0;
    uint64_t place = entry + 8;
    if (count * width > 4) {
      place = probe_.Read(entry + 8, 4).value_or(0);
      probe_.Need(place, count * width);
    }
    std::vector<uint32_t> values;
    const bool is_number = type == 3 || type == 4 || type == 13;
    for (uint64_t i = 0; wanted && is_number && i < std::min(count, kMaxValues); ++i) {
      const std::optional<uint32_t> value = probe_.Read(place + width * i, width);
      if (!value) {
        break;
      }
      values.push_back(*value);
    }
    return values;
  }

  FileProbe& probe_;
  std::vector<uint32_t> pending_;
  std::set<uint32_t> visited_;
  uint64_t missing_tiles_ = 0;
};

}  // namespace

Result<FileHead> ReadFileHead(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return Fail(ErrorCode::kIo, "{}: no such file", path.string());
  }
  if (std::filesystem::is_directory(status)) {
    return Fail(ErrorCode::kIo, "{}: is a folder, not a file", path.string());
  }
  std::ifstream stream(path, std::ios::binary);
  FileHead head;
  head.bytes.resize(kHeadBytes);
  if (!stream) {
    return Fail(ErrorCode::kIo, "{}: cannot be opened: {}", path.string(),
                std::generic_category().message(errno));
  }
  stream.read(head.bytes.data(), static_cast<std::streamsize>(kHeadBytes));
  head.bytes.resize(static_cast<size_t>(stream.gcount()));
  head.file_bytes = std::filesystem::file_size(path, error);
  if (error || stream.bad()) {
    return Fail(ErrorCode::kIo, "{}: cannot be read", path.string());
  }
  if (head.bytes.empty()) {
    return Fail(ErrorCode::kBadData, "{}: is empty; copy it again", path.string());
  }
  return head;
}

bool IsTiffHead(const std::string& bytes) {
  return bytes.starts_with(std::string("II*\0", 4)) || bytes.starts_with(std::string("MM\0*", 4));
}

Status CheckPngIsWhole(const std::filesystem::path& path) {
  const Result<FileHead> head = ReadFileHead(path);
  if (!head) {
    return tl::unexpected(head.error());
  }
  constexpr uint32_t kEndMark = 0x49454E44;  // "IEND"
  FileProbe probe(path, head->file_bytes);
  uint64_t chunk = 8;
  std::optional<uint32_t> type;
  do {
    const std::optional<uint32_t> length = probe.Read(chunk, 4);
    type = probe.Read(chunk + 4, 4);
    chunk += 12 + uint64_t{length.value_or(0)};  // length, type and checksum
    probe.Need(chunk, 0);
  } while (type && *type != kEndMark);
  if (probe.NeededBytes() > head->file_bytes) {
    return CutShort(path, head->file_bytes, probe.NeededBytes());
  }
  return {};
}

Status CheckTiffIsWhole(const std::filesystem::path& path) {
  const Result<FileHead> head = ReadFileHead(path);
  if (!head) {
    return tl::unexpected(head.error());
  }
  FileProbe probe(path, head->file_bytes);
  probe.SetBigEndian(head->bytes.starts_with("MM"));
  TiffWalk walk(probe);
  walk.Run();
  if (walk.MissingTiles() > 0) {
    return Fail(ErrorCode::kBadData,
                "{}: is damaged: {} tiles of its picture are not in its directory; copy it again",
                path.string(), walk.MissingTiles());
  }
  if (probe.NeededBytes() > head->file_bytes) {
    return CutShort(path, head->file_bytes, probe.NeededBytes());
  }
  return {};
}

}  // namespace sateen
