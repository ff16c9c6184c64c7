#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "imaging/exposure_settings.h"

namespace sateen {

struct CameraInfo {
  std::string model;    // as the camera says it
  std::string port;     // where it was found: "usb:001,004", "ptpip:192.168.1.1", "folder:incoming"
  std::string profile;  // the camera family whose names of settings are used
};

// A file that has arrived whole on this computer.
struct CapturedFile {
  std::filesystem::path path;
  std::string name_on_camera;
  std::uint64_t bytes = 0;
};

// The camera of the rig, as a capture sees it. One owner, one thread at a time. Implementations say
// in their headers which states they have; for a caller there are two, open and not: Open() begins,
// Close() ends, and after a failed Capture() the camera is either still open, or every call fails
// with kDevice until Open() has found it again.
class TetheredCamera {
 public:
  TetheredCamera() = default;
  TetheredCamera(const TetheredCamera&) = delete;
  TetheredCamera& operator=(const TetheredCamera&) = delete;
  virtual ~TetheredCamera() = default;

  // Finds the camera, connects, and checks what a capture needs: RAW files, manual exposure and,
  // where the camera says it, manual focus. kDevice: which of them is missing, and how to fix it.
  [[nodiscard]] virtual Result<CameraInfo> Open() = 0;

  // Sets what differs from what the camera has, reads everything back and returns that.
  // kInvalidArgument: a value that cannot be set; the message names its two settable neighbours.
  [[nodiscard]] virtual Result<ExposureSettings> Configure(const ExposureSettings& settings) = 0;

  // Returns the exposure times that may be set, ascending; empty where the camera does not say. [s]
  [[nodiscard]] virtual std::vector<double> ExposureTimes() const = 0;

  // Takes one frame. It is downloaded to a new file in `folder`, its size is checked, and it is
  // deleted from the camera. A file in `folder` is whole: what arrives in part is removed.
  // kTimeout: nothing whole within the deadline; kDevice: the camera refused, or is gone; kIo: the
  // file cannot be written.
  [[nodiscard]] virtual Result<CapturedFile> Capture(const std::filesystem::path& folder,
                                                     std::chrono::milliseconds deadline) = 0;

  // Returns whether the latest Capture() failed for a reason that only a person can fix: a full
  // card.
  [[nodiscard]] virtual bool NeedsAPerson() const { return false; }

  virtual void Close() noexcept = 0;
};

}  // namespace sateen
