#include "imaging/file_check.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <vector>

namespace sateen {
namespace {

constexpr size_t kHeadBytes = 16;

Status CheckReaches(const InputFile& file, uint64_t needed_bytes) {
  return needed_bytes <= file.Bytes()
             ? Status()
             : Fail(ErrorCode::kBadData,
                    "{}: is cut short: it has {} bytes and needs at least {}; copy it again",
                    file.Path().string(), file.Bytes(), needed_bytes);
}

// Reads numbers at places of a file, either byte order; remembers how far the file would have to
// reach for all that was asked of it.
class FileProbe {
 public:
  explicit FileProbe(const InputFile& file) : file_(file) {}

  void SetBigEndian(bool big_endian) { big_endian_ = big_endian; }
  void Need(uint64_t offset, uint64_t count) {
    needed_bytes_ = std::max(needed_bytes_, offset + count);
  }
  // Reads an unsigned integer of `width` bytes; nothing if the file ends before it.
  std::optional<uint32_t> Read(uint64_t offset, size_t width) {
    Need(offset, width);
    if (!Load(offset, width)) {
      return std::nullopt;
    }
    const char* const bytes = page_.data() + (offset - page_start_);
    uint32_t value = 0;
    for (size_t i = 0; i < width; ++i) {
      value = value << 8 | static_cast<unsigned char>(bytes[big_endian_ ? i : width - 1 - i]);
    }
    return value;
  }
  [[nodiscard]] uint64_t NeededBytes() const { return needed_bytes_; }

 private:
  // Makes page_ hold the bytes; false where the file ends before them.
  bool Load(uint64_t offset, size_t width) {
    if (offset >= page_start_ && offset + width <= page_start_ + page_.size()) {
      return true;
    }
    page_.resize(kPageBytes);
    page_start_ = offset;
    page_.resize(file_.ReadAt(offset, page_).value_or(0));
    return page_.size() >= width;
  }

  static constexpr size_t kPageBytes = 4096;
  const InputFile& file_;
  std::string page_;  // part of the file, from page_start_
  uint64_t page_start_ = 0;
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
    while (!pending_.empty() && !Overflows()) {
      const uint32_t offset = pending_.back();
      pending_.pop_back();
      if (offset != 0 && visited_.size() < kMaxDirectories && visited_.insert(offset).second) {
        VisitDirectory(offset);
      }
    }
  }
  // Tiles that the directories do not list.
  [[nodiscard]] uint64_t MissingTiles() const { return missing_tiles_; }

  // Returns true if there was more than is walked.
  [[nodiscard]] bool Overflows() const { return entries_ > kMaxEntries || values_ > kMaxValues; }

  // Over all directories. Cameras write some hundred entries, and a value per strip or tile.
  static constexpr uint64_t kMaxEntries = 1U << 14;
  static constexpr uint64_t kMaxValues = 1U << 20;

 private:
  static constexpr size_t kMaxDirectories = 64;
  using Fields = std::map<uint32_t, std::vector<uint32_t>>;

  void VisitDirectory(uint64_t offset) {
    const uint32_t entries = probe_.Read(offset, 2).value_or(0);
    Fields fields;
    entries_ += entries;
    for (uint32_t i = 0; i < entries && !Overflows(); ++i) {
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
    for (uint64_t i = 0; wanted && is_number && i < count && !Overflows(); ++i) {
      ++values_;
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
  uint64_t entries_ = 0;
  uint64_t values_ = 0;
  uint64_t missing_tiles_ = 0;
};

}  // namespace

Result<std::string> ReadHead(const InputFile& file) {
  std::string head(kHeadBytes, '\0');
  const Result<size_t> count = file.ReadAt(0, head);
  if (!count) {
    return tl::unexpected(count.error());
  }
  if (*count == 0) {
    return Fail(ErrorCode::kBadData, "{}: is empty; copy it again", file.Path().string());
  }
  head.resize(*count);
  return head;
}

bool IsTiffHead(const std::string& bytes) {
  return bytes.starts_with(std::string("II*\0", 4)) || bytes.starts_with(std::string("MM\0*", 4));
}

Status CheckPngIsWhole(const InputFile& file) {
  constexpr uint32_t kEndMark = 0x49454E44;  // "IEND"
  constexpr int kMaxChunks = 1 << 20;
  FileProbe probe(file);
  uint64_t chunk = 8;
  std::optional<uint32_t> type;
  int chunks = 0;
  do {
    const std::optional<uint32_t> length = probe.Read(chunk, 4);
    type = probe.Read(chunk + 4, 4);
    chunk += 12 + uint64_t{length.value_or(0)};  // length, type and checksum
    probe.Need(chunk, 0);
  } while (type && *type != kEndMark && ++chunks < kMaxChunks);
  if (chunks == kMaxChunks) {
    return Fail(ErrorCode::kBadData, "{}: has more than {} chunks; save it again",
                file.Path().string(), kMaxChunks);
  }
  return CheckReaches(file, probe.NeededBytes());
}

Status CheckTiffIsWhole(const InputFile& file) {
  return ReadHead(file).and_then([&](const std::string& head) -> Status {
    FileProbe probe(file);
    probe.SetBigEndian(head.starts_with("MM"));
    TiffWalk walk(probe);
    walk.Run();
    if (walk.Overflows()) {
      return Fail(ErrorCode::kBadData,
                  "{}: its directories hold more than {} entries or {} values; it is damaged: copy "
                  "it again",
                  file.Path().string(), TiffWalk::kMaxEntries, TiffWalk::kMaxValues);
    }
    if (walk.MissingTiles() > 0) {
      return Fail(ErrorCode::kBadData,
                  "{}: is damaged: {} tiles of its picture are not in its directory; copy it again",
                  file.Path().string(), walk.MissingTiles());
    }
    return CheckReaches(file, probe.NeededBytes());
  });
}

}  // namespace sateen
