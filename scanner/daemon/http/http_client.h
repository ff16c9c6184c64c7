#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/task.h"
#include "scanner/capture/capture_request.h"
#include "scanner/capture/preview.h"
#include "scanner/daemon/board_job.h"
#include "scanner/daemon/device_list.h"
#include "scanner/daemon/job.h"
#include "scanner/daemon/light_job.h"

namespace sateen {

/// The daemon at the other end of a Unix socket. Each call is a connection of its own.
///
/// Errors  what the daemon answers, with its code and message, so that a caller ends with the same
///         exit status as without a daemon; kDevice: another job has the rig (who, and since when),
///         or the daemon has gone; kTimeout: it does not answer
class DaemonClient {
 public:
  explicit DaemonClient(std::filesystem::path socket);

  // Sends a request and returns the answer's body.
  [[nodiscard]] Result<std::string> Ask(const std::string& method, const std::string& path,
                                        const std::string& body = "") const;

  // Posts the job, tells `observer` of its progress, repeats its notes as notices, cancels it when
  // the task is cancelled or it cannot be followed, and waits for its end. Returns its result.
  [[nodiscard]] Result<std::string> RunJob(const std::string& path, const std::string& body,
                                           const std::function<void(const JobEvent&)>& observer,
                                           const Task& task) const;

  [[nodiscard]] const std::filesystem::path& Socket() const { return socket_; }

 private:
  std::filesystem::path socket_;
};

/// Returns the running daemon, if any: at $SATEEN_SOCKET if that is set (none if it is empty); else
/// at $XDG_RUNTIME_DIR/sateen.sock, else at /run/sateen/sateen.sock. A socket at which nobody
/// answers, or to which the user may not connect, is no daemon.
///
/// Errors  kTimeout, kBadData: something answers there, but not as a daemon does
[[nodiscard]] Result<std::optional<DaemonClient>> FindDaemon();

// Runs RunCapture in the daemon. Paths are made absolute. The summary's session is the one on disk.
[[nodiscard]] Result<CaptureSummary> CaptureByDaemon(const DaemonClient& daemon,
                                                     const CaptureRequest& request,
                                                     const Task& task,
                                                     const CaptureObserver& observer = {});
// Runs ForecastCapture in the daemon.
[[nodiscard]] Result<CaptureForecast> ForecastByDaemon(const DaemonClient& daemon,
                                                       const CaptureRequest& request);
// Runs TakePreview in the daemon, into the file `output`. The answer has no picture.
[[nodiscard]] Result<Preview> PreviewByDaemon(const DaemonClient& daemon,
                                              const PreviewRequest& request,
                                              const std::filesystem::path& output,
                                              const Task& task);
// Runs KeepLightOn in the daemon. kCancelled: somebody else turned it off.
[[nodiscard]] Result<bool> KeepLightOnByDaemon(const DaemonClient& daemon,
                                               const LightRequest& request, const Task& task,
                                               const std::function<void(const LightOn&)>& began);
[[nodiscard]] Result<BoardWord> ChangeBoardByDaemon(const DaemonClient& daemon,
                                                    const BoardChange& change);
// Turns all lights off, also while a job runs, which it cancels.
[[nodiscard]] Status LightsOffByDaemon(const DaemonClient& daemon);
[[nodiscard]] Result<std::vector<DeviceReply>> DevicesByDaemon(const DaemonClient& daemon);

}  // namespace sateen
