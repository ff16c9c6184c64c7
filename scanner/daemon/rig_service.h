#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/daemon/job.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/rig_devices.h"

namespace sateen {

// Why a job was not begun.
struct JobRefusal {
  Error error;
  // Job that has the rig, or runs beside it, in the way; absent where the daemon is ending.
  std::optional<JobRecord> holder;
};

// The board as it last said it.
struct KnownBoard {
  std::string port;
  std::string firmware;
  std::string protocol;
  int lights = 0;
};

struct RigState {
  std::optional<KnownBoard> board;
  std::optional<CameraInfo> camera;
  std::optional<JobRecord> job;       // the one that has the rig
  std::optional<JobRecord> last_job;  // the latest with the rig that has ended
  // Channels that may be on; where no job runs, those that the board says are on, which none is.
  std::vector<int> lit;
  std::string lights_fault;  // why the board's word that all is off is missing; else empty
};

// How a wait for the end of a job ended.
enum class WaitEnd {
  kEnded,
  kBoardLost,  // the job's lights are to be off, and the board does not confirm it so far
  kRunning,
};

struct JobWait {
  WaitEnd end = WaitEnd::kRunning;
  std::string lights_fault;  // why the board has not confirmed; only of kBoardLost
};

struct FollowedEvents {
  std::vector<JobEvent> events;
  bool ended = false;  // no more will come
};

/// Owns the rig: one job at a time has it, in a thread of this service.
///
///     state      what leads out of it
///     idle       Begin: the job's work runs                                    -> running
///     running    the work returns, throws, or was cancelled and returns        -> ending
///     ending     the board has said that all lights are off, or cannot be
///                reached for longer than its 2 s of silence                    -> idle
///
/// A job counts as running until its lights are off, so that no light is ever on while the state
/// says that no job runs. Where the board answers, and does not say that all is off, the job has
/// failed, whatever it did, and State() names the lights. Begin while a job runs is refused at once:
/// the error names who has the rig and since when. There is no queue, but an urgent job, as turning
/// the lights off, that was refused comes next if it asks again. All calls may come from any thread.
///
/// A job that needs no devices, as a solve, runs in a thread of its own beside the job that has the
/// rig: neither waits for the other. There is one such job at a time.
///
/// The latest 1000 events of each job are kept, and the latest 20 ended jobs.
class RigService {
 public:
  // `desk_grace`: how long Stop() waits for a job without devices.
  explicit RigService(std::unique_ptr<RigDevices> devices,
                      std::chrono::milliseconds desk_grace = std::chrono::seconds(5));
  RigService(const RigService&) = delete;
  RigService& operator=(const RigService&) = delete;
  ~RigService();  // Stop()

  // Begins a job and returns its number.
  [[nodiscard]] tl::expected<std::uint64_t, JobRefusal> Begin(JobRequest request);
  // Begins a job and waits for its end. Cancels it when the client has left, and then returns it as
  // it is.
  [[nodiscard]] tl::expected<JobRecord, JobRefusal> RunToEnd(JobRequest request,
                                                             const ClientLeft& left = {});

  [[nodiscard]] RigState State() const;
  [[nodiscard]] std::vector<JobRecord> Jobs() const;
  [[nodiscard]] std::optional<JobRecord> Find(std::uint64_t id) const;

  // Returns the events after the one numbered `after`: at once if there are any, else when one
  // comes or `longest` has passed. Returns nothing for an unknown job.
  [[nodiscard]] std::optional<FollowedEvents> Follow(std::uint64_t id, std::uint64_t after,
                                                     std::chrono::milliseconds longest) const;

  // Tells the job to stop; it has ended when its last event says so. False: not known.
  bool Cancel(std::uint64_t id, const std::string& who);
  // Waits until no job has the rig; false where one still does after `longest`.
  bool WaitIdle(std::chrono::milliseconds longest) const;

  // Waits until the job has ended, until it turns out that the board does not answer, or until
  // `longest` has passed.
  [[nodiscard]] JobWait AwaitEnd(std::uint64_t id, std::chrono::milliseconds longest) const;

  // Refuses new jobs, cancels the running ones, waits for their end, turns all lights off and
  // closes the devices. The second time it does nothing. A job without devices that does not end
  // in time, as one that reads from a disk that has gone, is left to a stray thread.
  void Stop();

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;  // shared with the thread of jobs without devices
};

}  // namespace sateen
