#include "scanner/devices/folder_camera.h"

#include <fmt/ranges.h>

#include <system_error>
#include <thread>
#include <utility>

#include "imaging/raw.h"
#include "scanner/devices/frame_file.h"

namespace sateen {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

Status FolderCameraOptions::Validate() const {
  if (quiet < milliseconds(1) || interval < milliseconds(1)) {
    return Fail(ErrorCode::kInvalidArgument, "quiet is {} ms, interval {} ms; need at least 1",
                quiet.count(), interval.count());
  }
  return {};
}

FolderCamera::FolderCamera(FolderCameraOptions options) : options_(std::move(options)) {
  if (!options_.wait) {
    options_.wait = [](milliseconds time) { std::this_thread::sleep_for(time); };
  }
}

Result<std::map<std::string, uint64_t>> FolderCamera::NewFiles() const {
  std::map<std::string, uint64_t> files;
  std::error_code failed;
  for (fs::directory_iterator entry(options_.folder, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    const std::string name = entry->path().filename().string();
    std::error_code gone;  // a file may be renamed while it is looked at
    if (IsRawName(name) && !name.starts_with('.') && !known_.contains(name) &&
        entry->is_regular_file(gone)) {
      if (const uint64_t bytes = entry->file_size(gone); !gone) {
        files[name] = bytes;
      }
    }
  }
  if (failed) {
    return Fail(ErrorCode::kDevice,
                "{}: cannot be read: {}; name the folder into which the camera's program drops "
                "its files",
                options_.folder.string(), failed.message());
  }
  return files;
}

Result<CameraInfo> FolderCamera::Open() {
  if (Status valid = options_.Validate(); !valid) {
    return tl::unexpected(valid.error());
  }
  open_ = false;
  known_.clear();
  left_alone_.clear();
  const auto before = NewFiles();
  if (!before) {
    return tl::unexpected(before.error());
  }
  for (const auto& [name, bytes] : *before) {
    known_.insert(name);
    left_alone_.insert(name);
  }
  open_ = true;
  return CameraInfo{.model = "files in a folder",
                    .port = "folder:" + options_.folder.string(),
                    .profile = "folder"};
}

Result<ExposureSettings> FolderCamera::Configure(const ExposureSettings& settings) {
  if (!open_) {
    return Fail(ErrorCode::kDevice, "the folder camera is not open");
  }
  set_ = settings;
  return settings;
}

Result<CapturedFile> FolderCamera::Capture(const fs::path& folder, milliseconds deadline) {
  if (!open_) {
    return Fail(ErrorCode::kDevice, "the folder camera is not open");
  }
  Result<std::map<std::string, uint64_t>> files = NewFiles();
  for (const auto& [name, bytes] : files ? *files : std::map<std::string, uint64_t>{}) {
    known_.insert(name);
    left_alone_.insert(name);
  }
  std::pair<std::string, uint64_t> last;
  milliseconds unchanged(0);
  Error why = {ErrorCode::kTimeout, ""};
  for (milliseconds waited(0); files && waited < deadline; waited += options_.interval) {
    options_.wait(options_.interval);
    files = NewFiles();
    if (!files || files->empty()) {
      continue;
    }
    if (files->size() > 1) {
      return Fail(
          ErrorCode::kDevice,
          "{}: {} and {} arrived for one frame, and it is not known which is right; see that the "
          "camera takes one frame at a time, and take it again",
          options_.folder.string(), files->begin()->first, files->rbegin()->first);
    }
    const std::pair<std::string, uint64_t> now = *files->begin();
    unchanged = now == last ? unchanged + options_.interval : milliseconds(0);
    last = now;
    if (unchanged < options_.quiet || now.second == 0) {
      continue;
    }
    Result<CapturedFile> taken = Take(now.first, now.second, folder);
    if (taken || taken.error().code != ErrorCode::kBadData) {
      return taken;
    }
    why = taken.error();  // it may still be written to
    unchanged = milliseconds(0);
  }
  if (!files) {
    return tl::unexpected(files.error());
  }
  if (why.code == ErrorCode::kBadData) {
    return tl::unexpected(why);
  }
  return Fail(ErrorCode::kTimeout, "{}: no new RAW file within {} ms{}{}; {}",
              options_.folder.string(), deadline.count(),
              left_alone_.empty() ? "" : ", and those from before are left alone: ",
              fmt::join(left_alone_, ", "),
              "check that the camera was released and that its program saves RAW files there");
}

Result<CapturedFile> FolderCamera::Take(const std::string& name, uint64_t bytes,
                                        const fs::path& folder) {
  const fs::path source = options_.folder / name;
  const fs::path part = folder / fmt::format(".{}.part", name);
  std::error_code failed;
  fs::copy_file(source, part, fs::copy_options::overwrite_existing, failed);
  if (failed) {
    std::error_code ignored;
    fs::remove(part, ignored);
    return Fail(ErrorCode::kIo, "{}: cannot be copied to {}: {}", source.string(), folder.string(),
                failed.message());
  }
  Status whole = CheckRawFrame(part, source.string(), set_);
  if (whole && fs::file_size(part, failed) != bytes) {
    whole = Fail(ErrorCode::kBadData, "{} was still growing", source.string());
  }
  if (!whole) {
    fs::remove(part, failed);
    return tl::unexpected(whole.error());
  }
  const Result<fs::path> place = PlaceAnew(part, folder, name);
  if (!place) {
    return tl::unexpected(place.error());
  }
  known_.insert(name);
  return CapturedFile{.path = *place, .name_on_camera = name, .bytes = bytes};
}

}  // namespace sateen
