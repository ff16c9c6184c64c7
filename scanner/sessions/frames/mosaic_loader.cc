#include "scanner/sessions/frames/mosaic_loader.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "core/parallel.h"
#include "imaging/raw.h"
#include "scanner/sessions/frames/frame_loader.h"
#include "scanner/sessions/frames/sensor_reading.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

// Where decoded rows go. Frames may come at the same time, each from one thread.
class MosaicStore : public MosaicRows {
 public:
  [[nodiscard]] virtual Status Put(size_t frame, int row, std::span<const uint16_t> readings) = 0;
};

class MemoryStore final : public MosaicStore {
 public:
  MemoryStore(ImageSize size_px, size_t frames) : mosaics_(frames, Image<uint16_t>(size_px)) {}

  Status Put(size_t frame, int row, std::span<const uint16_t> readings) override {
    Image<uint16_t>& mosaic = mosaics_[frame];
    std::ranges::copy(readings,
                      mosaic.pixels.begin() + static_cast<std::ptrdiff_t>(mosaic.Index(0, row)));
    return {};
  }
  [[nodiscard]] std::span<const uint16_t> Read(size_t frame, int begin, int end,
                                               std::vector<uint16_t>& /*buffer*/) const override {
    return RowsOf(mosaics_[frame], begin, end);
  }

 private:
  std::vector<Image<uint16_t>> mosaics_;
};

// Opens a new file that never has a name or, on disks that cannot do this, loses it at once.
int OpenNameless(const fs::path& dir) {
  const int fd = open(dir.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (fd >= 0 || (errno != EOPNOTSUPP && errno != EISDIR)) {
    return fd;
  }
  std::string name = (dir / ".sateen-mosaics-XXXXXX").string();
  const int named = mkostemp(name.data(), O_CLOEXEC);
  if (named >= 0) {
    unlink(name.c_str());
  }
  return named;
}

// A file that has no name, so that nothing of it is left whatever happens.
class FileStore final : public MosaicStore {
 public:
  static Result<std::unique_ptr<FileStore>> Open(const fs::path& dir, ImageSize size_px,
                                                 size_t frames) {
    const int fd = OpenNameless(dir);
    if (fd < 0) {
      return Fail(ErrorCode::kIo, "{}: a scratch file cannot be created here: {}", dir.string(),
                  std::generic_category().message(errno));
    }
    auto store = std::unique_ptr<FileStore>(new FileStore(fd, dir, size_px));
    const auto bytes = static_cast<off_t>(sizeof(uint16_t) * size_px.PixelCount() * frames);
    // Here, and not in the middle of the decoding.
    if (const int error = posix_fallocate(fd, 0, bytes); error != 0) {
      return Fail(ErrorCode::kIo,
                  "{}: the readings of {} frames need {} MB of scratch space here: {}; make room, "
                  "or choose another folder for the maps",
                  dir.string(), frames, bytes / 1'000'000, std::generic_category().message(error));
    }
    return store;
  }
  FileStore(const FileStore&) = delete;
  FileStore& operator=(const FileStore&) = delete;
  ~FileStore() override { close(fd_); }

  Status Put(size_t frame, int row, std::span<const uint16_t> readings) override {
    const auto* bytes = reinterpret_cast<const char*>(readings.data());
    size_t left = readings.size_bytes();
    off_t at = OffsetOf(frame, row);
    while (left > 0) {
      const ssize_t written = pwrite(fd_, bytes, left, at);
      if (written <= 0 && errno != EINTR) {
        return Fail(ErrorCode::kIo, "{}: scratch file: {}", dir_.string(),
                    std::generic_category().message(errno));
      }
      const ssize_t done = std::max<ssize_t>(written, 0);
      bytes += done;
      at += done;
      left -= static_cast<size_t>(done);
    }
    return {};
  }
  [[nodiscard]] std::span<const uint16_t> Read(size_t frame, int begin, int end,
                                               std::vector<uint16_t>& buffer) const override {
    buffer.resize(static_cast<size_t>(size_px_.width) * static_cast<size_t>(end - begin));
    auto* bytes = reinterpret_cast<char*>(buffer.data());
    size_t left = buffer.size() * sizeof(uint16_t);
    off_t at = OffsetOf(frame, begin);
    while (left > 0) {
      const ssize_t done = pread(fd_, bytes, left, at);
      if (done <= 0) {
        if (done < 0 && errno == EINTR) {
          continue;
        }
        return {};
      }
      bytes += done;
      at += done;
      left -= static_cast<size_t>(done);
    }
    return buffer;
  }

 private:
  FileStore(int fd, fs::path dir, ImageSize size_px)
      : fd_(fd), dir_(std::move(dir)), size_px_(size_px) {}
  [[nodiscard]] off_t OffsetOf(size_t frame, int row) const {
    const size_t sites = frame * size_px_.PixelCount() +
                         static_cast<size_t>(row) * static_cast<size_t>(size_px_.width);
    return static_cast<off_t>(sites * sizeof(uint16_t));
  }

  int fd_;
  fs::path dir_;
  ImageSize size_px_;
};

Result<std::unique_ptr<MosaicStore>> OpenStore(const fs::path& scratch_dir, ImageSize size_px,
                                               size_t frames, std::uintmax_t in_memory) {
  if (sizeof(uint16_t) * size_px.PixelCount() * frames <= in_memory) {
    return std::make_unique<MemoryStore>(size_px, frames);
  }
  return FileStore::Open(scratch_dir, size_px, frames)
      .map([](std::unique_ptr<FileStore> file) -> std::unique_ptr<MosaicStore> { return file; });
}

// (1) and (2) of scanner/sessions/frames/sensor_reading.h, for integers.
Result<MosaicFrame> FrameOf(const FrameFile& file, const RawReadings& readings,
                            const std::optional<SensorNoise>& noise) {
  RawMosaic levels{.cfa = readings.cfa, .white = readings.white};
  for (const float black : readings.black) {
    levels.black += black / 4.0F;
  }
  return ReadingOf(file, levels).map([&](const SensorReading& reading) {
    MosaicFrame frame{.name = file.path.string()};
    for (size_t site = 0; site < 4; ++site) {
      const float range = readings.white - readings.black[site];
      const float unit = reading.balance[readings.cfa[site]] / static_cast<float>(file.exposure);
      frame.per_dn[site] = unit / range;
      frame.at_zero[site] = unit * (reading.shift - readings.black[site] / range);
      frame.saturated_dn =
          std::min(frame.saturated_dn, readings.black[site] + reading.saturation * range);
    }
    if (noise) {
      frame.gain_dn = noise->gain_dn;
      frame.read_dn = std::hypot(noise->read_dn, kRoundingDn);
    }
    return frame;
  });
}

// Facts that are known once the first frame is decoded, and one entry for each frame.
struct Decoding {
  MosaicMemory memory;
  std::optional<SensorNoise> noise;
  std::vector<FrameFile> files;  // lit, then dark
  std::vector<MosaicFrame> frames;
  std::vector<std::string> hashes;
  ImageSize size_px;
  std::array<uint8_t, 4> cfa = {};
  std::unique_ptr<MosaicStore> store;
};

Status CheckLike(const Decoding& decoding, const FrameFile& file, const RawReadings& readings) {
  if (Status same = CheckSize(file.path.string(), readings.size_px, decoding.size_px); !same) {
    return same;
  }
  return readings.cfa == decoding.cfa
             ? Status()
             : Fail(ErrorCode::kBadData,
                    "{}: has its colours in another order than {}; need frames of one camera",
                    file.path.string(), decoding.files[0].path.string());
}

Status DecodeFrame(size_t k, const fs::path& scratch_dir, Decoding& decoding) {
  const FrameFile& file = decoding.files[k];
  Result<std::string> hash = CheckedHash(file);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  decoding.hashes[k] = *std::move(hash);
  const auto take = [&](const RawReadings& readings) -> Status {
    if (k == 0) {
      decoding.size_px = readings.size_px;
      decoding.cfa = readings.cfa;
      Result<std::unique_ptr<MosaicStore>> store =
          OpenStore(scratch_dir, readings.size_px, decoding.files.size(), decoding.memory.readings);
      if (!store) {
        return tl::unexpected(store.error());
      }
      decoding.store = *std::move(store);
    }
    Result<MosaicFrame> frame = CheckLike(decoding, file, readings).and_then([&] {
      return FrameOf(file, readings, decoding.noise);
    });
    if (!frame) {
      return tl::unexpected(frame.error());
    }
    decoding.frames[k] = *std::move(frame);
    Status status;
    for (int row = 0; status && row < readings.size_px.height; ++row) {
      status = decoding.store->Put(k, row, readings.Row(row));
    }
    return status;
  };
  return TakeRawReadings(file.path, take, file.limit);
}

Status DecodeAll(const fs::path& scratch_dir, const Task& task, Decoding& decoding) {
  const auto count = static_cast<int>(decoding.files.size());
  task.BeginStage("reading", count);
  if (Status first = DecodeFrame(0, scratch_dir, decoding); !first) {
    return first;
  }
  task.Advance();
  const std::uintmax_t bytes = sizeof(uint16_t) * decoding.size_px.PixelCount();
  const int at_once = static_cast<int>(std::clamp<std::uintmax_t>(
      decoding.memory.decoded / bytes, 1, static_cast<std::uintmax_t>(task.ThreadCount())));
  std::vector<Status> outcomes(decoding.files.size());
  const Status ran =
      ParallelFor(count - 1, 1, task.WithThreads(at_once), [&](int begin, int /*end*/) {
        const auto k = static_cast<size_t>(begin) + 1;
        outcomes[k] = DecodeFrame(k, scratch_dir, decoding);
      });
  const auto failed = std::ranges::find_if(outcomes, [](const Status& s) { return !s; });
  return !ran || failed == outcomes.end() ? ran : *failed;
}

}  // namespace

std::optional<std::string> WhyNoMosaics(const ReadPlan& plan) {
  const auto is_raw = [](const FrameFile& file) { return IsRawName(file.path); };
  for (const LightFiles& files : plan.lit) {
    if (files.size() > 1) {
      return "a light has several exposures, which are merged first";
    }
    if (!std::ranges::all_of(files, is_raw)) {
      return "the frames are not camera RAW";
    }
    if (!files.empty() && !files.front().shift_px.isZero(0.0)) {
      return "frames were moved, and are laid over the first as interpolated colours";
    }
  }
  if (!std::ranges::all_of(plan.dark, is_raw)) {
    return "the dark frames are not camera RAW";
  }
  return std::nullopt;
}

Result<LoadedMosaics> LoadMosaics(const ReadPlan& plan, const std::optional<SensorNoise>& noise,
                                  const fs::path& scratch_dir, const Task& task,
                                  const MosaicMemory& memory) {
  Decoding decoding{.memory = memory, .noise = noise};
  for (const LightFiles& files : plan.lit) {
    decoding.files.push_back(files.front());
  }
  decoding.files.insert(decoding.files.end(), plan.dark.begin(), plan.dark.end());
  decoding.frames.resize(decoding.files.size());
  decoding.hashes.resize(decoding.files.size());
  if (const Status decoded = DecodeAll(scratch_dir, task, decoding); !decoded) {
    return tl::unexpected(decoded.error());
  }
  LoadedMosaics loaded{.noise = noise};
  const auto first_dark = decoding.frames.begin() + static_cast<std::ptrdiff_t>(plan.lit.size());
  loaded.stack = {.size_px = decoding.size_px,
                  .cfa = decoding.cfa,
                  .lit = {decoding.frames.begin(), first_dark},
                  .dark = {first_dark, decoding.frames.end()},
                  .rows = std::move(decoding.store)};
  double sum = 0.0;
  for (const FrameFile& file : plan.dark) {
    sum += file.exposure * file.exposure;
  }
  for (const FrameFile& file : plan.dark) {
    loaded.stack.dark_weights.push_back(static_cast<float>(file.exposure * file.exposure / sum));
  }
  for (size_t k = 0; k < decoding.files.size(); ++k) {
    loaded.sha256_of_input[decoding.files[k].path.string()] = decoding.hashes[k];
  }
  if (noise) {
    loaded.sha256_of_input.insert(noise->sha256_of_input.begin(), noise->sha256_of_input.end());
  }
  return loaded;
}

}  // namespace sateen
