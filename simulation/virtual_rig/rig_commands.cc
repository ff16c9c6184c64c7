#include "simulation/virtual_rig/rig_commands.h"

#include <nlohmann/json.hpp>
#include <optional>

#include "simulation/virtual_rig/scene_commands.h"

namespace sateen {
namespace {

// Reads "12ms" or "0.5s".
Result<std::chrono::nanoseconds> TimeIn(const std::string& text) {
  const size_t unit = text.find_first_not_of("0123456789.");
  const std::string name = unit == std::string::npos ? "" : text.substr(unit);
  if (name != "ms" && name != "s") {
    return Fail(ErrorCode::kInvalidArgument, "the time is '{}'; need one such as 12ms or 0.5s",
                text);
  }
  return NumberIn(text.substr(0, unit), "the time", 0.0, 1e6).map([&](double value) {
    return std::chrono::nanoseconds(static_cast<int64_t>(value * (name == "s" ? 1e9 : 1e6)));
  });
}

std::string SceneEvent(const std::string& folder, bool read) {
  return fmt::format(R"("event":"scene","folder":{},"read":{})", nlohmann::json(folder).dump(),
                     read);
}

}  // namespace

RigCommands::RigCommands(RigLoop& loop, std::function<void(const Error&)> failed)
    : loop_(loop), failed_(std::move(failed)) {}

void RigCommands::HasCamera(SceneCamera& scene, VirtualCamera& camera) {
  scene_ = &scene;
  camera_ = &camera;
}

Result<RigAction> RigCommands::Parse(const std::string& line) {
  if (auto action = loop_.Parse(line)) {
    return *std::move(action);
  }
  if (scene_ != nullptr) {
    const auto read = [this](const std::string& dir, const Status& status) {
      if (!status) {
        failed_(status.error());
      }
      Post([this, event = SceneEvent(dir, status.has_value())] { loop_.Say(event); });
    };
    if (auto action = ParseSceneCommand(line, *scene_, *camera_, read)) {
      return *std::move(action);
    }
  }
  return Fail(ErrorCode::kInvalidArgument, "'{}' is no command; need one of {}, {}{}", line,
              kBoardCommands, scene_ != nullptr ? "" : "or with --scene ", kSceneCommands);
}

Status RigCommands::Do(const std::string& line) {
  return Parse(line).and_then([](const RigAction& action) { return action.act(); });
}

Status RigCommands::Schedule(const std::string& text) {
  const size_t colon = text.find(':');
  if (colon == std::string::npos) {
    return Fail(ErrorCode::kInvalidArgument,
                "'{}' does not say when; need N:COMMAND or N+TIME:COMMAND, such as 5:unplug or "
                "5+12ms:unplug",
                text);
  }
  const std::string when = text.substr(0, colon);
  const size_t plus = when.find('+');
  const Result<int> number = CountIn(when.substr(0, plus), "the capture", 1, 1'000'000);
  if (!number) {
    return tl::unexpected(number.error());
  }
  const auto after = plus == std::string::npos ? Result<std::chrono::nanoseconds>(0)
                                               : TimeIn(when.substr(plus + 1));
  if (!after) {
    return tl::unexpected(after.error());
  }
  Result<RigAction> action = Parse(text.substr(colon + 1));
  if (!action) {
    return tl::unexpected(action.error());
  }
  const std::lock_guard lock(mutex_);
  scheduled_.emplace(*number, Scheduled{*after, *std::move(action)});
  return {};
}

void RigCommands::CaptureAsked(int number) {
  std::vector<RigAction> at_once;
  {
    const std::lock_guard lock(mutex_);
    for (auto [at, end] = scheduled_.equal_range(number); at != end; at = scheduled_.erase(at)) {
      Scheduled& scheduled = at->second;
      if (scheduled.after.count() == 0 && !scheduled.action.on_board) {
        at_once.push_back(std::move(scheduled.action));
        continue;
      }
      posted_.emplace(Clock::now() + scheduled.after,
                      [this, action = std::move(scheduled.action)] { Run(action); });
    }
  }
  for (const RigAction& action : at_once) {
    Run(action);
  }
}

void RigCommands::Post(std::function<void()> action, Clock::time_point due) {
  const std::lock_guard lock(mutex_);
  posted_.emplace(due, std::move(action));
}

void RigCommands::Step() {
  const Clock::time_point now = Clock::now();
  std::vector<std::function<void()>> due;
  {
    const std::lock_guard lock(mutex_);
    const auto end = posted_.upper_bound(now);
    for (auto at = posted_.begin(); at != end; at = posted_.erase(at)) {
      due.push_back(std::move(at->second));
    }
  }
  for (const std::function<void()>& action : due) {
    action();
  }
}

void RigCommands::Run(const RigAction& action) const {
  if (const Status status = action.act(); !status) {
    failed_(status.error());
  }
}

}  // namespace sateen
