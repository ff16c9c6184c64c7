#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
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
///                reached twice, which takes longer than its 2 s of silence     -> idle
///
/// A job counts as running until its lights are off, so that no light is ever on while the state
/// says that no job runs. Where the board answers, and does not say that all is off, the job has
/// failed, whatever it did, and State() names the lights. Begin while a job runs is refused at once: the error names who has the
/// rig and since when. There is no queue. All calls may come from any thread.
///
/// A job that needs no devices, as a solve, runs in a thread of its own beside the job that has the
/// rig: neither waits for the other. There is one such job at a time.
///
/// The latest 1000 events of each job are kept, and the latest 20 ended jobs.
class RigService {
 public:
  explicit RigService(std::unique_ptr<RigDevices> devices);
  RigService(const RigService&) = delete;
  RigService& operator=(const RigService&) = delete;
  ~RigService();  // Stop()

  // Begins a job and returns its number.
  [[nodiscard]] tl::expected<std::uint64_t, JobRefusal> Begin(JobRequest request);
  // Begins a job and waits for its end.
  [[nodiscard]] tl::expected<JobRecord, JobRefusal> RunToEnd(JobRequest request);

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

  // Refuses new jobs, cancels the running ones, waits for their end, turns all lights off and
  // closes the devices. The second time it does nothing.
  void Stop();

 private:
  struct Job {
    JobRecord record;
    JobWork work;
    std::deque<JobEvent> events;
    std::atomic<bool> cancel = false;
    std::string cancelled_by;
  };
  class Context;
  // Runs one job at a time.
  struct Lane {
    Job* running = nullptr;
    std::thread thread;
  };

  [[nodiscard]] Lane& LaneOf(const JobRecord& job) { return job.has_rig ? rig_ : desk_; }
  void RunJobs(Lane& lane);
  [[nodiscard]] Result<std::string> Work(Job& job);
  // The board's answer to all off.
  struct LightsWord {
    std::string fault;         // why it has not confirmed; empty: it has
    bool contradicts = false;  // whether it answers, and says something else
    std::vector<int> lit;      // channels that it says are on
  };
  [[nodiscard]] LightsWord ConfirmLightsOff();
  void NoteRig(LightsWord lights);                            // with the mutex held
  void End(Job& job, Result<std::string> result);             // with the mutex held
  void ForgetOldJobs();                                       // with the mutex held
  void Append(Job& job, std::string type, std::string data);  // with the mutex held
  [[nodiscard]] Job* Known(std::uint64_t id) const;           // with the mutex held

  std::unique_ptr<RigDevices> devices_;  // used by the rig's thread alone

  mutable std::mutex mutex_;  // for all below
  mutable std::condition_variable changed_;
  std::deque<std::unique_ptr<Job>> jobs_;  // the latest last
  std::uint64_t next_id_ = 1;
  std::optional<KnownBoard> board_;
  std::optional<CameraInfo> camera_;
  std::vector<int> lit_;
  std::string lights_fault_;
  bool stopping_ = false;
  Lane rig_;
  Lane desk_;  // lane of jobs without devices
};

}  // namespace sateen
