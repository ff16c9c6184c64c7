#include "scanner/daemon/rig_service.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "core/check.h"
#include "core/notice.h"
#include "core/stray_thread.h"
#include "scanner/daemon/answer_json.h"

namespace sateen {
namespace {

constexpr std::size_t kEventsKept = 1000;
constexpr std::ptrdiff_t kEndedJobsKept = 20;
// How long the rig is kept for an urgent job that found it in use, once it asks no more.
constexpr std::chrono::seconds kKept{3};

}  // namespace

class RigService::Impl {
 public:
  Impl(std::unique_ptr<RigDevices> devices, std::chrono::milliseconds desk_grace)
      : devices_(std::move(devices)), desk_grace_(desk_grace) {}

  void StartThreads(const std::shared_ptr<Impl>& self) {
    rig_.thread = std::thread([this] { RunJobs(rig_); });
    StartStray([self] { self->RunJobs(self->desk_); });
  }

  tl::expected<std::uint64_t, JobRefusal> Begin(JobRequest request);
  tl::expected<JobRecord, JobRefusal> RunToEnd(JobRequest request, const ClientLeft& left);
  RigState State() const;
  std::vector<JobRecord> Jobs() const;
  std::optional<JobRecord> Find(std::uint64_t id) const;
  std::optional<FollowedEvents> Follow(std::uint64_t id, std::uint64_t after,
                                       std::chrono::milliseconds longest) const;
  bool Cancel(std::uint64_t id, const std::string& who);
  bool WaitIdle(std::chrono::milliseconds longest) const;
  JobWait AwaitEnd(std::uint64_t id, std::chrono::milliseconds longest) const;
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
    bool over = false;   // it runs no more jobs
    std::thread thread;  // the rig's; the desk's is a stray one
  };

  [[nodiscard]] Lane& LaneOf(const JobRecord& job) { return job.has_rig ? rig_ : desk_; }
  void RunJobs(Lane& lane);
  [[nodiscard]] Result<std::string> Work(Job& job);
  // The board's answer to all off.
  struct LightsWord {
    std::string fault;         // why it has not confirmed; empty: it has, or has never answered
    bool contradicts = false;  // whether it answers, and says something else
    std::vector<int> lit;      // channels that it says are on
  };
  [[nodiscard]] LightsWord ConfirmLightsOff();
  [[nodiscard]] LightsWord TryLightsOff(std::chrono::milliseconds port_wait);
  void NoteRig(LightsWord lights);                            // with the mutex held
  void End(Job& job, Result<std::string> result);             // with the mutex held
  void ForgetOldJobs();                                       // with the mutex held
  void Append(Job& job, std::string type, std::string data);  // with the mutex held
  [[nodiscard]] Job* Known(std::uint64_t id) const;           // with the mutex held

  std::unique_ptr<RigDevices> devices_;  // used by the rig's thread alone
  const std::chrono::milliseconds desk_grace_;

  mutable std::mutex mutex_;  // for all below
  mutable std::condition_variable changed_;
  std::deque<std::unique_ptr<Job>> jobs_;  // the latest last
  std::uint64_t next_id_ = 1;
  std::optional<KnownBoard> board_;
  std::optional<CameraInfo> camera_;
  std::vector<int> lit_;
  std::string lights_fault_;
  bool board_lost_ = false;  // the job that ends waits for a board that does not answer
  bool stopping_ = false;
  std::chrono::steady_clock::time_point kept_until_;  // until then the rig is for urgent jobs
  Lane rig_;
  Lane desk_;  // lane of jobs without devices
};

class RigService::Impl::Context : public JobContext {
 public:
  Context(Impl& service, Job& job) : service_(service), job_(job), task_{.cancel = &job.cancel} {}
  RigDevices& Devices() override {
    SATEEN_CHECK(job_.record.has_rig);
    return *service_.devices_;
  }
  const Task& GetTask() const override { return task_; }
  void Report(std::string json) override {
    const std::lock_guard lock(service_.mutex_);
    service_.Append(job_, "progress", std::move(json));
  }
  void Lit(std::vector<int> channels) override {
    const std::lock_guard lock(service_.mutex_);
    service_.lit_ = std::move(channels);
  }

 private:
  Impl& service_;
  Job& job_;
  Task task_;
};

tl::expected<std::uint64_t, JobRefusal> RigService::Impl::Begin(JobRequest request) {
  const std::lock_guard lock(mutex_);
  if (stopping_) {
    return tl::unexpected<JobRefusal>(
        {.error = {ErrorCode::kDevice, "the daemon is ending; start it again"}});
  }
  Lane& lane = request.needs_rig ? rig_ : desk_;
  const auto now = std::chrono::steady_clock::now();
  if (request.needs_rig && !request.urgent && lane.running == nullptr && now < kept_until_) {
    return tl::unexpected<JobRefusal>(
        {.error = {ErrorCode::kDevice, "the lights are being turned off; try again"}});
  }
  if (request.urgent) {
    kept_until_ = lane.running != nullptr ? now + kKept : now;
  }
  if (lane.running != nullptr) {
    JobRefusal refusal = {.error = {ErrorCode::kDevice, BusyText(lane.running->record)}};
    refusal.holder = lane.running->record;
    return tl::unexpected(std::move(refusal));
  }
  auto job = std::make_unique<Job>();
  job->record = {.id = next_id_++,
                 .kind = std::move(request.kind),
                 .what = std::move(request.what),
                 .owner = std::move(request.owner),
                 .since = std::chrono::system_clock::now(),
                 .has_rig = request.needs_rig};
  job->work = std::move(request.work);
  lane.running = job.get();
  jobs_.push_back(std::move(job));
  ForgetOldJobs();
  changed_.notify_all();
  return lane.running->record.id;
}

tl::expected<JobRecord, JobRefusal> RigService::Impl::RunToEnd(JobRequest request,
                                                               const ClientLeft& left) {
  const tl::expected<std::uint64_t, JobRefusal> id = Begin(std::move(request));
  if (!id) {
    return tl::unexpected(id.error());
  }
  std::unique_lock lock(mutex_);
  std::optional<JobRecord> record;
  const auto has_ended = [&] {
    const Job* job = Known(*id);
    // Gone only when 20 others have ended since.
    record = job == nullptr ? JobRecord{.id = *id, .state = JobState::kDone} : job->record;
    return record->state != JobState::kRunning;
  };
  while (!changed_.wait_for(lock, kLookForClient, has_ended)) {
    if (left && left()) {
      lock.unlock();
      Cancel(*id, record->owner + ", who has left");
      break;
    }
  }
  return *std::move(record);
}

RigState RigService::Impl::State() const {
  const std::lock_guard lock(mutex_);
  RigState state = {.board = board_, .camera = camera_, .lit = lit_, .lights_fault = lights_fault_};
  if (rig_.running != nullptr) {
    state.job = rig_.running->record;
  }
  for (const auto& job : jobs_) {
    if (job.get() != rig_.running && job->record.has_rig) {
      state.last_job = job->record;
    }
  }
  return state;
}

std::vector<JobRecord> RigService::Impl::Jobs() const {
  const std::lock_guard lock(mutex_);
  std::vector<JobRecord> records;
  for (const auto& job : jobs_) {
    records.push_back(job->record);
  }
  return records;
}

std::optional<JobRecord> RigService::Impl::Find(std::uint64_t id) const {
  const std::lock_guard lock(mutex_);
  const Job* job = Known(id);
  return job == nullptr ? std::nullopt : std::optional(job->record);
}

std::optional<FollowedEvents> RigService::Impl::Follow(std::uint64_t id, std::uint64_t after,
                                                       std::chrono::milliseconds longest) const {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, longest, [&] {
    const Job* job = Known(id);
    return job == nullptr || job->record.last_event > after ||
           job->record.state != JobState::kRunning;
  });
  const Job* job = Known(id);
  if (job == nullptr) {
    return std::nullopt;
  }
  FollowedEvents followed = {.ended = job->record.state != JobState::kRunning};
  std::ranges::copy_if(job->events, std::back_inserter(followed.events),
                       [&](const JobEvent& event) { return event.sequence > after; });
  return followed;
}

bool RigService::Impl::Cancel(std::uint64_t id, const std::string& who) {
  const std::lock_guard lock(mutex_);
  Job* job = Known(id);
  if (job == nullptr) {
    return false;
  }
  if (job->record.state == JobState::kRunning && !job->cancel) {
    job->cancelled_by = who;
    job->cancel = true;
  }
  return true;
}

bool RigService::Impl::WaitIdle(std::chrono::milliseconds longest) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, longest, [&] { return rig_.running == nullptr; });
}

JobWait RigService::Impl::AwaitEnd(std::uint64_t id, std::chrono::milliseconds longest) const {
  std::unique_lock lock(mutex_);
  const auto is_running = [&] {
    const Job* job = Known(id);
    return job != nullptr && job->record.state == JobState::kRunning;
  };
  changed_.wait_for(lock, longest, [&] { return !is_running() || board_lost_; });
  if (!is_running()) {
    return {.end = WaitEnd::kEnded};
  }
  return board_lost_ ? JobWait{.end = WaitEnd::kBoardLost, .lights_fault = lights_fault_}
                     : JobWait{.end = WaitEnd::kRunning};
}

void RigService::Impl::Stop() {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) {
      return;
    }
    stopping_ = true;
    for (Job* job : {rig_.running, desk_.running}) {
      if (job != nullptr && !job->cancel) {
        job->cancelled_by = "the end of the daemon";
        job->cancel = true;
      }
    }
    changed_.notify_all();
  }
  rig_.thread.join();
  std::unique_lock lock(mutex_);
  const bool over = changed_.wait_for(lock, desk_grace_, [&] { return desk_.over; });
  if (!over && desk_.running != nullptr) {
    End(*desk_.running, Fail(ErrorCode::kCancelled, "the job did not end; it was left behind"));
  }
  lock.unlock();
  devices_->Release();
}

void RigService::Impl::RunJobs(Lane& lane) {
  while (true) {
    Job* job = nullptr;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || lane.running != nullptr; });
      job = lane.running;
    }
    if (job == nullptr) {
      const std::lock_guard lock(mutex_);
      lane.over = true;
      changed_.notify_all();
      return;
    }
    Result<std::string> result = Work(*job);
    const bool has_rig = job->record.has_rig;
    LightsWord lights = has_rig ? ConfirmLightsOff() : LightsWord();
    if (lights.contradicts) {
      result = Fail(ErrorCode::kDevice, "{}{}",
                    result ? "" : result.error().message + "; and then: ", lights.fault);
    }
    const std::lock_guard lock(mutex_);
    if (has_rig) {
      NoteRig(std::move(lights));
    }
    if (job->record.state == JobState::kRunning) {  // not left behind
      End(*job, std::move(result));
    }
  }
}

Result<std::string> RigService::Impl::Work(Job& job) {
  Context context(*this, job);
  const NoticesOfThread notes([&](const std::string& text) {
    const std::lock_guard lock(mutex_);
    Append(job, "note", NoteJson(text));
  });
  // Nothing that a job does may end the daemon, or leave its lights on.
  try {
    const JobWork work = std::exchange(job.work, nullptr);  // released with the job
    return work(context);
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kIo, "internal error in a job: {}", error.what());
  }
}

RigService::Impl::LightsWord RigService::Impl::ConfirmLightsOff() {
  LightsWord lights = TryLightsOff(std::chrono::milliseconds(0));
  if (lights.fault.empty()) {
    return lights;
  }
  {
    // Tells those that wait for the lights now, before the port is waited for.
    const std::lock_guard lock(mutex_);
    lights_fault_ = lights.fault;
    board_lost_ = !lights.contradicts;
    changed_.notify_all();
  }
  return TryLightsOff(kUntilGreetingTimeout);  // longer than the board's 2 s of silence
}

RigService::Impl::LightsWord RigService::Impl::TryLightsOff(std::chrono::milliseconds port_wait) {
  const std::string unconfirmed =
      "the board did not confirm that all lights are off; it turns them off by itself when it "
      "hears nothing for 2 s: ";
  const Result<LightBoard*> board = devices_->Board(port_wait);
  if (!board && !devices_->BoardHasAnswered()) {
    return {};  // nothing of this daemon's can be on
  }
  if (!board) {
    return {.fault = unconfirmed + board.error().message};
  }
  const Result<BoardState> off = (*board)->AllOff();
  if (off) {
    const BoardInfo& info = (*board)->Info();
    const std::lock_guard lock(mutex_);
    board_ = {.port = (*board)->PortName(),
              .firmware = info.build_id,
              .protocol = info.protocol,
              .lights = static_cast<int>(info.lights.size())};
    return {};
  }
  LightsWord lights = {.fault = unconfirmed + off.error().message,
                       .contradicts = (*board)->state() == LightBoard::State::kReady};
  if (const std::optional<BoardState>& said = (*board)->LastSaid()) {
    lights.lit = LitChannels(said->lit);
  }
  return lights;
}

void RigService::Impl::NoteRig(LightsWord lights) {
  lit_ = std::move(lights.lit);
  board_lost_ = false;
  lights_fault_ = std::move(lights.fault);
  camera_ = devices_->OpenCamera();
  if (!lights_fault_.empty()) {
    board_.reset();
  }
}

void RigService::Impl::End(Job& job, Result<std::string> result) {
  JobRecord& record = job.record;
  record.ended = std::chrono::system_clock::now();
  if (result) {
    record.state = JobState::kDone;
    record.result = *std::move(result);
    Append(job, "done", record.result);
  } else {
    record.state = JobState::kFailed;
    record.error = std::move(result.error());
    if (record.error->code == ErrorCode::kCancelled && !job.cancelled_by.empty()) {
      record.error->message += "; cancelled by " + job.cancelled_by;
    }
    Append(job, "failed", ErrorJson(*record.error));
  }
  LaneOf(record).running = nullptr;
  changed_.notify_all();
}

void RigService::Impl::ForgetOldJobs() {
  const auto has_ended = [](const auto& job) { return job->record.state != JobState::kRunning; };
  for (auto ended = std::ranges::count_if(jobs_, has_ended); ended > kEndedJobsKept; --ended) {
    jobs_.erase(std::ranges::find_if(jobs_, has_ended));
  }
}

void RigService::Impl::Append(Job& job, std::string type, std::string data) {
  job.events.push_back(
      {.sequence = ++job.record.last_event, .type = std::move(type), .data = std::move(data)});
  if (job.events.size() > kEventsKept) {
    job.events.pop_front();
  }
  changed_.notify_all();
}

RigService::Impl::Job* RigService::Impl::Known(std::uint64_t id) const {
  const auto job = std::ranges::find_if(jobs_, [&](const auto& j) { return j->record.id == id; });
  return job == jobs_.end() ? nullptr : job->get();
}

RigService::RigService(std::unique_ptr<RigDevices> devices, std::chrono::milliseconds desk_grace)
    : impl_(std::make_shared<Impl>(std::move(devices), desk_grace)) {
  impl_->StartThreads(impl_);
}

RigService::~RigService() { Stop(); }

tl::expected<std::uint64_t, JobRefusal> RigService::Begin(JobRequest request) {
  return impl_->Begin(std::move(request));
}

tl::expected<JobRecord, JobRefusal> RigService::RunToEnd(JobRequest request,
                                                         const ClientLeft& left) {
  return impl_->RunToEnd(std::move(request), left);
}

RigState RigService::State() const { return impl_->State(); }

std::vector<JobRecord> RigService::Jobs() const { return impl_->Jobs(); }

std::optional<JobRecord> RigService::Find(std::uint64_t id) const { return impl_->Find(id); }

std::optional<FollowedEvents> RigService::Follow(std::uint64_t id, std::uint64_t after,
                                                 std::chrono::milliseconds longest) const {
  return impl_->Follow(id, after, longest);
}

bool RigService::Cancel(std::uint64_t id, const std::string& who) { return impl_->Cancel(id, who); }

bool RigService::WaitIdle(std::chrono::milliseconds longest) const {
  return impl_->WaitIdle(longest);
}

JobWait RigService::AwaitEnd(std::uint64_t id, std::chrono::milliseconds longest) const {
  return impl_->AwaitEnd(id, longest);
}

void RigService::Stop() { impl_->Stop(); }

}  // namespace sateen
