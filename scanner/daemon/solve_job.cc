#include "scanner/daemon/solve_job.h"

#include <algorithm>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "core/json.h"
#include "pipelines/solve/solve.h"

namespace sateen {
namespace {

constexpr int kReportsPerStage = 20;

// Reports the progress of a task to those who follow its job.
class JobProgress : public Progress {
 public:
  explicit JobProgress(JobContext& job) : job_(job) {}

  void BeginStage(std::string_view name, int total) override {
    const std::lock_guard lock(mutex_);
    stage_ = name;
    total_ = std::max(total, 1);
    done_ = 0;
    reported_ = 0;
    Report();
  }
  void Advance(int steps) override {
    const std::lock_guard lock(mutex_);
    done_ = std::min(done_ + steps, total_);
    if ((done_ - reported_) * static_cast<int64_t>(kReportsPerStage) >= total_) {
      reported_ = done_;
      Report();
    }
  }
  void Clear() override {}

 private:
  void Report() {
    const nlohmann::ordered_json event = {{"stage", stage_}, {"done", done_}, {"total", total_}};
    job_.Report(JsonText(event));
  }

  JobContext& job_;
  std::mutex mutex_;  // for all below
  std::string stage_;
  int total_ = 1;
  int done_ = 0;
  int reported_ = 0;
};

}  // namespace

JobRequest SolveJob(SolveRequest request, std::string owner) {
  std::string what = request.options.capture.string();
  return {.kind = "solve",
          .what = std::move(what),
          .owner = std::move(owner),
          .needs_rig = false,
          .work = [request = std::move(request)](JobContext& job) {
            JobProgress progress(job);
            Task task = job.GetTask().WithThreads(request.threads);
            task.progress = &progress;
            return SolveSession(request.options, task).map([](SolveOutcome outcome) {
              return std::move(outcome.report);
            });
          }};
}

}  // namespace sateen
