#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "scanner/devices/tethered_camera.h"

namespace sateen {

struct FolderCameraOptions {
  std::filesystem::path folder;  // where another program drops files
  // A file counts when its size has not changed for so long; at least 1 ms.
  std::chrono::milliseconds quiet{500};
  // How often the folder is looked at; at least 1 ms.
  std::chrono::milliseconds interval{50};
  // Waits between two looks; absent: sleeps. Deadlines count these waits, so that a test that puts
  // its own here decides what happens when.
  std::function<void(std::chrono::milliseconds)> wait;

  [[nodiscard]] Status Validate() const;
};

/// A camera that this computer does not speak to: another program, or a card with a radio, drops
/// its RAW files into a folder. Whoever releases it (the LED board's shutter output, or a hand)
/// does so while Capture() waits.
///
/// A frame is the one RAW file that appears in that time, keeps its size for `quiet` and decodes.
/// It is copied; the folder is left as it is. Files that were there before, at Open() or between
/// two frames, are no frame of ours and are left alone; LeftAlone() names them, and so does the
/// error where no other comes. Each file is taken once. Files that are not RAW by their name are
/// not looked at.
///
/// Settings cannot be set: Configure() keeps them, and a file that says it was exposed otherwise is
/// an error.
///
/// Errors of Capture() beside those of the interface: kDevice: two new files; kBadData: the new
/// file does not decode until the deadline.
class FolderCamera : public TetheredCamera {
 public:
  explicit FolderCamera(FolderCameraOptions options);

  [[nodiscard]] Result<CameraInfo> Open() override;
  [[nodiscard]] Result<ExposureSettings> Configure(const ExposureSettings& settings) override;
  [[nodiscard]] std::vector<double> ExposureTimes() const override { return {}; }
  [[nodiscard]] Result<CapturedFile> Capture(const std::filesystem::path& folder,
                                             std::chrono::milliseconds deadline) override;
  void Close() noexcept override { open_ = false; }

  [[nodiscard]] const std::set<std::string>& LeftAlone() const { return left_alone_; }

 private:
  // Sizes of the RAW files in the folder that are not known yet.
  Result<std::map<std::string, uint64_t>> NewFiles() const;
  Result<CapturedFile> Take(const std::string& name, uint64_t bytes,
                            const std::filesystem::path& folder);

  FolderCameraOptions options_;
  bool open_ = false;
  std::set<std::string> known_;  // taken or left alone
  std::set<std::string> left_alone_;
  std::optional<ExposureSettings> set_;
};

}  // namespace sateen
