#include "scanner/sessions/frames/frame_loader.h"

#include <utility>

#include "core/parallel.h"
#include "core/sha256.h"
#include "scanner/sessions/frames/frame_shift.h"
#include "scanner/sessions/frames/light_reader.h"

namespace sateen {
namespace {

// Adds up one by one, in their order: memory for one dark frame, and the same bits every time.
Result<Image3> MeanDark(const std::vector<FrameFile>& dark, Encoding encoding, ImageSize size_px,
                        const Task& task, LoadedFrames& result) {
  Image3 mean(size_px);
  double sum = 0.0;
  for (const FrameFile& file : dark) {
    sum += file.exposure * file.exposure;
  }
  for (const FrameFile& file : dark) {
    if (const Status status = task.CheckCancelled(); !status) {
      return tl::unexpected(status.error());
    }
    const Result<LightReading> loaded = ReadLight({file}, encoding);
    if (!loaded) {
      return tl::unexpected(loaded.error());
    }
    const Image3& rgb = loaded->frame.rgb;
    if (const Status status = CheckSize(loaded->frame.name, rgb.Size(), size_px); !status) {
      return tl::unexpected(status.error());
    }
    const auto weight = static_cast<float>(file.exposure * file.exposure / sum);
    for (size_t c = 0; c < 3; ++c) {
      for (size_t p = 0; p < mean[c].pixels.size(); ++p) {
        mean[c].pixels[p] += weight * rgb[c].pixels[p];
      }
    }
    result.sha256_of_input.insert(loaded->sha256_of_input.begin(), loaded->sha256_of_input.end());
    task.Advance();
  }
  return mean;
}

void Subtract(const Image3& dark, LightFrame& frame) {
  for (size_t c = 0; c < 3; ++c) {
    for (size_t p = 0; p < dark[c].pixels.size(); ++p) {
      float& value = frame.rgb[c].pixels[p];
      value = value >= frame.full_scale ? frame.full_scale : value - dark[c].pixels[p];
    }
  }
}

// Moves the frames into `result`; the first failure in their order is the error.
Status Collect(std::vector<Result<LightReading>>& frames, LoadedFrames& result) {
  for (Result<LightReading>& loaded : frames) {
    if (!loaded) {
      return tl::unexpected(loaded.error());
    }
    result.stack.push_back(std::move(loaded->frame));
    const LightFrame& frame = result.stack.back();
    if (Status status = CheckSize(frame.name, frame.rgb.Size(), result.stack[0].rgb.Size());
        !status) {
      return status;
    }
    result.srgb_count += loaded->was_srgb ? 1 : 0;
    result.sha256_of_input.merge(loaded->sha256_of_input);
  }
  return {};
}

}  // namespace

Result<std::string> CheckedHash(const FrameFile& file) {
  Result<std::string> hash = Sha256OfFile(file.path);
  if (hash && file.sha256 && *file.sha256 != *hash) {
    return Fail(ErrorCode::kBadData,
                "{}: its SHA-256 is {} but the session recorded {}: the file has changed since the "
                "capture; restore it or capture again",
                file.path.string(), *hash, *file.sha256);
  }
  return hash;
}

Result<LoadedFrames> LoadFrames(const std::vector<LightFiles>& lit,
                                const std::vector<FrameFile>& dark, Encoding encoding,
                                const Task& task) {
  const auto count = static_cast<int>(lit.size());
  task.BeginStage("reading", count + static_cast<int>(dark.size()));
  std::vector<Result<LightReading>> frames(lit.size());
  const Status ran = ParallelFor(count, 1, task, [&](int begin, int) {
    const auto k = static_cast<size_t>(begin);
    frames[k] = ReadLight(lit[k], encoding);
  });
  if (!ran) {
    return tl::unexpected(ran.error());
  }
  LoadedFrames result;
  if (const Status status = Collect(frames, result); !status) {
    return tl::unexpected(status.error());
  }
  Image3 mean;
  if (!dark.empty()) {
    Result<Image3> of_dark = MeanDark(dark, encoding, result.stack[0].rgb.Size(), task, result);
    if (!of_dark) {
      return tl::unexpected(of_dark.error());
    }
    mean = *std::move(of_dark);
  }
  const Task silent{.threads = task.threads, .progress = nullptr, .cancel = task.cancel};
  const Status finished = ParallelFor(count, 1, silent, [&](int begin, int) {
    const auto k = static_cast<size_t>(begin);
    if (!dark.empty()) {
      Subtract(mean, result.stack[k]);
    }
    LayOverFirst(lit[k].front().shift_px, result.stack[k]);  // the dark is the sensor's and stays
  });
  if (!finished) {
    return tl::unexpected(finished.error());
  }
  return result;
}

}  // namespace sateen
