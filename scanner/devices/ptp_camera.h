#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "scanner/devices/camera_profiles.h"
#include "scanner/devices/tethered_camera.h"
#include "scanner/devices/worker_process.h"

namespace sateen {

struct PtpCameraOptions {
  // libgphoto2's name: "usb:001,004", "ptpip:192.168.1.1". Empty: the only camera that is found.
  std::string port;
  // Program that talks to the camera; empty: WorkerProcess::DefaultProgram().
  std::filesystem::path worker;
  // Longest wait for the answer to one call; at least 1 ms. Connecting may take four times as long.
  std::chrono::milliseconds answer_timeout{5000};
  // After a frame that did not come in time, how long the next Open() waits for it, so that it is
  // not taken for a later one; at least 0.
  std::chrono::milliseconds settle{1500};
  // Whether each file is decoded before it counts. A caller that decodes it anyway turns this off.
  bool decode = true;

  [[nodiscard]] Status Validate() const;
};

// A camera found by ListPtpCameras().
struct FoundCamera {
  std::string model;
  std::string port;
};

/// A camera on USB or on the network, by libgphoto2 in a process of its own (camera_worker/), which
/// is killed where a call does not return in time.
///
///     state     legal                            what leads out of it
///     kClosed   Open                             -> kOpen; an error leaves it kClosed
///     kOpen     everything                       a call does not return, the connection is gone,
///                                                a frame does not come in time       -> kLost
///                                                Close -> kClosed
///     kLost     Open, Close                      Open begins with a new process      -> kOpen
///
/// A camera that refuses (a setting, a full card, busy to the end of the deadline) stays kOpen, and
/// so does one whose file finds no room on this computer's disk; the file stays on its card then.
/// The connection stays up from Open to Close.
///
/// A frame is a file that the camera announces after the shutter was released and not before the
/// exposure can be over; what is announced earlier is left over from a capture that was given up. A
/// second file of the same frame is an error. The file is downloaded to a hidden name in `folder`,
/// counts when it has the size that the camera says, decodes as RAW and was exposed as set, then
/// gets its place and is deleted from the camera; a download that ends too early is tried once
/// more. Nothing is flushed to the disk.
class PtpCamera : public TetheredCamera {
 public:
  enum class State { kClosed, kOpen, kLost };

  explicit PtpCamera(PtpCameraOptions options = {});
  ~PtpCamera() override;

  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] Result<CameraInfo> Open() override;
  [[nodiscard]] Result<ExposureSettings> Configure(const ExposureSettings& settings) override;
  [[nodiscard]] std::vector<double> ExposureTimes() const override { return exposure_times_; }
  [[nodiscard]] Result<CapturedFile> Capture(const std::filesystem::path& folder,
                                             std::chrono::milliseconds deadline) override;
  [[nodiscard]] bool NeedsAPerson() const override { return card_is_full_; }
  void Close() noexcept override;

 private:
  struct Setting;
  struct FileOnCamera;
  class Deadline;

  Result<CameraInfo> Connect();
  Result<nlohmann::json> Ask(const nlohmann::json& request, std::chrono::milliseconds longest);
  Result<std::optional<Setting>> Find(const std::vector<std::string>& names);
  Status Require(const RequiredSetting& required);
  Status ReadExposureTimes();
  Result<std::optional<double>> SetNumber(const std::vector<std::string>& names, double wanted,
                                          const char* what);
  Result<FileOnCamera> Expose(const Deadline& deadline);
  Status DropLeftovers();
  Result<CapturedFile> Fetch(const FileOnCamera& file, const std::filesystem::path& folder,
                             const Deadline& deadline);
  Status Download(const FileOnCamera& file, const std::filesystem::path& path,
                  const Deadline& deadline);

  PtpCameraOptions options_;
  std::optional<WorkerProcess> worker_;
  State state_ = State::kClosed;
  bool frame_owing_ = false;   // the shutter was released, and no file has come for it
  bool card_is_full_ = false;  // at the latest capture
  CameraInfo info_;
  const CameraProfile* profile_ = nullptr;
  std::vector<double> exposure_times_;
  std::optional<ExposureSettings> set_;
};

// Lists all cameras on USB that libgphoto2 knows.
[[nodiscard]] Result<std::vector<FoundCamera>> ListPtpCameras(
    const std::filesystem::path& worker = {});

}  // namespace sateen
