#include "scanner/daemon/rig_service.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "core/check.h"
#include "scanner/daemon/answer_json.h"

namespace sateen {
namespace {

constexpr std::size_t kEventsKept = 1000;
constexpr std::ptrdiff_t kEndedJobsKept = 20;

}  // namespace

class RigService::Context : public JobContext {
 public:
  Context(RigService& service, Job& job)
      : service_(service), job_(job), task_{.cancel = &job.cancel} {}
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
  RigService& service_;
  Job& job_;
  Task task_;
};

RigService::RigService(std::unique_ptr<RigDevices> devices) : devices_(std::move(devices)) {
  rig_.thread = std::thread([this] { RunJobs(rig_); });
  desk_.thread = std::thread([this] { RunJobs(desk_); });
}

RigService::~RigService() { Stop(); }

tl::expected<std::uint64_t, JobRefusal> RigService::Begin(JobRequest request) {
  const std::lock_guard lock(mutex_);
  if (stopping_) {
    return tl::unexpected<JobRefusal>(
        {.error = {ErrorCode::kDevice, "the daemon is ending; start it again"}});
  }
  Lane& lane = request.needs_rig ? rig_ : desk_;
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
  if (job->record.state == JobState::kRunning && !job->cancel) {
    job->cancelled_by = who;
    job->cancel = true;
  }
  return true;
}

bool RigService::WaitIdle(std::chrono::milliseconds longest) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, longest, [&] { return rig_.running == nullptr; });
}

void RigService::Stop() {
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
  desk_.thread.join();
  devices_->Release();
}

void RigService::RunJobs(Lane& lane) {
  while (true) {
    Job* job = nullptr;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || lane.running != nullptr; });
      job = lane.running;
    }
    if (job == nullptr) {
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
    End(*job, std::move(result));
  }
}

Result<std::string> RigService::Work(Job& job) {
  Context context(*this, job);
  // Nothing that a job does may end the daemon, or leave its lights on.
  try {
    const JobWork work = std::exchange(job.work, nullptr);  // released with the job
    return work(context);
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kIo, "internal error in a job: {}", error.what());
  }
}

RigService::LightsWord RigService::ConfirmLightsOff() {
  LightsWord lights;
  for (int tries = 0; tries < 2; ++tries) {
    const Result<LightBoard*> board = devices_->Board();
    if (!board && !devices_->BoardHasAnswered()) {
      return {};  // nothing of this daemon's can be on
    }
    if (!board) {
      lights = {.fault = board.error().message};
      continue;
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
    lights = {.fault = off.error().message,
              .contradicts = (*board)->state() == LightBoard::State::kReady};
    if (const std::optional<BoardState>& said = (*board)->LastSaid()) {
      lights.lit = LitChannels(said->lit);
    }
  }
  lights.fault =
      "the board did not confirm that all lights are off; it turns them off by itself when it "
      "hears nothing for 2 s: " +
      lights.fault;
  return lights;
}

void RigService::NoteRig(LightsWord lights) {
  lit_ = std::move(lights.lit);
  lights_fault_ = std::move(lights.fault);
  camera_ = devices_->OpenCamera();
  if (!lights_fault_.empty()) {
    board_.reset();
  }
}

void RigService::End(Job& job, Result<std::string> result) {
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

void RigService::ForgetOldJobs() {
  const auto has_ended = [](const auto& job) { return job->record.state != JobState::kRunning; };
  for (auto ended = std::ranges::count_if(jobs_, has_ended); ended > kEndedJobsKept; --ended) {
    jobs_.erase(std::ranges::find_if(jobs_, has_ended));
  }
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
