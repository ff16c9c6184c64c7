#include "scanner/daemon/rig_service.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "scanner/daemon/answer_json.h"

namespace sateen {
namespace {

constexpr std::size_t kEventsKept = 1000;
constexpr std::size_t kJobsKept = 21;  // the running one, and 20 that have ended

}  // namespace

class RigService::Context : public JobContext {
 public:
  Context(RigService& service, Job& job)
      : service_(service), job_(job), task_{.cancel = &job.cancel} {}
  RigDevices& Devices() override { return *service_.devices_; }
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
  RigService& service_;
  Job& job_;
  Task task_;
};

RigService::RigService(std::unique_ptr<RigDevices> devices)
    : devices_(std::move(devices)), thread_([this] { RunJobs(); }) {}

RigService::~RigService() { Stop(); }

tl::expected<std::uint64_t, JobRefusal> RigService::Begin(JobRequest request) {
  const std::lock_guard lock(mutex_);
  if (stopping_) {
    return tl::unexpected<JobRefusal>(
        {.error = {ErrorCode::kDevice, "the daemon is ending; start it again"}});
  }
  if (running_ != nullptr) {
    JobRefusal refusal = {.error = {ErrorCode::kDevice, BusyText(running_->record)}};
    refusal.holder = running_->record;
    return tl::unexpected(std::move(refusal));
  }
  auto job = std::make_unique<Job>();
  job->record = {.id = next_id_++,
                 .kind = std::move(request.kind),
                 .what = std::move(request.what),
                 .owner = std::move(request.owner),
                 .since = std::chrono::system_clock::now()};
  job->work = std::move(request.work);
  running_ = job.get();
  jobs_.push_back(std::move(job));
  if (jobs_.size() > kJobsKept) {
    jobs_.pop_front();
  }
  changed_.notify_all();
  return running_->record.id;
}

tl::expected<JobRecord, JobRefusal> RigService::RunToEnd(JobRequest request) {
  const tl::expected<std::uint64_t, JobRefusal> id = Begin(std::move(request));
  if (!id) {
    return tl::unexpected(id.error());
  }
  std::unique_lock lock(mutex_);
  std::optional<JobRecord> record;
  changed_.wait(lock, [&] {
    const Job* job = Known(*id);
    // Gone only when 20 others have ended since.
    record = job == nullptr ? JobRecord{.id = *id, .state = JobState::kDone} : job->record;
    return record->state != JobState::kRunning;
  });
  return *std::move(record);
}

RigState RigService::State() const {
  const std::lock_guard lock(mutex_);
  RigState state = {.board = board_, .camera = camera_, .lit = lit_, .lights_fault = lights_fault_};
  if (running_ != nullptr) {
    state.job = running_->record;
  }
  for (const auto& job : jobs_) {
    if (job.get() != running_) {
      state.last_job = job->record;
    }
  }
  return state;
}

std::vector<JobRecord> RigService::Jobs() const {
  const std::lock_guard lock(mutex_);
  std::vector<JobRecord> records;
  for (const auto& job : jobs_) {
    records.push_back(job->record);
  }
  return records;
}

std::optional<JobRecord> RigService::Find(std::uint64_t id) const {
  const std::lock_guard lock(mutex_);
  const Job* job = Known(id);
  return job == nullptr ? std::nullopt : std::optional(job->record);
}

std::optional<FollowedEvents> RigService::Follow(std::uint64_t id, std::uint64_t after,
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

bool RigService::Cancel(std::uint64_t id, const std::string& who) {
  const std::lock_guard lock(mutex_);
  Job* job = Known(id);
  if (job == nullptr) {
    return false;
  }
  if (job == running_ && !job->cancel) {
    job->cancelled_by = who;
    job->cancel = true;
  }
  return true;
}

bool RigService::WaitIdle(std::chrono::milliseconds longest) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, longest, [&] { return running_ == nullptr; });
}

void RigService::Stop() {
  {
    const std::lock_guard lock(mutex_);
    if (!thread_.joinable()) {
      return;
    }
    stopping_ = true;
    if (running_ != nullptr && !running_->cancel) {
      running_->cancelled_by = "the end of the daemon";
      running_->cancel = true;
    }
    changed_.notify_all();
  }
  thread_.join();
}

void RigService::RunJobs() {
  while (true) {
    Job* job = nullptr;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || running_ != nullptr; });
      job = running_;
    }
    if (job == nullptr) {
      break;
    }
    Result<std::string> result = Work(*job);
    std::string fault = ConfirmLightsOff();
    End(*job, std::move(result), std::move(fault));
  }
  devices_->Release();
}

Result<std::string> RigService::Work(Job& job) {
  Context context(*this, job);
  // Nothing that a job does may end the daemon, or leave its lights on.
  try {
    const JobWork work = std::exchange(job.work, nullptr);  // what it holds goes with the job
    return work(context);
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kIo, "internal error in a job: {}", error.what());
  }
}

std::string RigService::ConfirmLightsOff() {
  std::string fault;
  for (int tries = 0; tries < 2; ++tries) {
    const Result<LightBoard*> board = devices_->Board();
    if (!board && !devices_->BoardHasAnswered()) {
      return {};  // nothing of this daemon's can be on
    }
    if (!board) {
      fault = board.error().message;
      continue;
    }
    const Result<BoardState> off = (*board)->AllOff();
    if (off && off->lit == 0) {
      const BoardInfo& info = (*board)->Info();
      const std::lock_guard lock(mutex_);
      board_ = {.port = (*board)->PortName(),
                .firmware = info.build_id,
                .protocol = info.protocol,
                .lights = static_cast<int>(info.lights.size())};
      return {};
    }
    fault = off ? "the board says that a light is on" : off.error().message;
  }
  return "the board did not confirm that all lights are off; it turns them off by itself when it "
         "hears nothing for 2 s: " +
         fault;
}

void RigService::End(Job& job, Result<std::string> result, std::string lights_fault) {
  const std::lock_guard lock(mutex_);
  lit_.clear();
  lights_fault_ = std::move(lights_fault);
  camera_ = devices_->OpenCamera();
  if (!lights_fault_.empty()) {
    board_.reset();
  }
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
  running_ = nullptr;
  changed_.notify_all();
}

void RigService::Append(Job& job, std::string type, std::string data) {
  job.events.push_back(
      {.sequence = ++job.record.last_event, .type = std::move(type), .data = std::move(data)});
  if (job.events.size() > kEventsKept) {
    job.events.pop_front();
  }
  changed_.notify_all();
}

RigService::Job* RigService::Known(std::uint64_t id) const {
  const auto job = std::ranges::find_if(jobs_, [&](const auto& j) { return j->record.id == id; });
  return job == jobs_.end() ? nullptr : job->get();
}

}  // namespace sateen
