#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "simulation/virtual_rig/camera/scene_camera.h"
#include "simulation/virtual_rig/camera/virtual_camera.h"
#include "simulation/virtual_rig/rig_action.h"
#include "simulation/virtual_rig/rig_loop.h"

namespace sateen {

// The commands of the virtual rig, at once or when a certain capture is asked for. The board
// belongs to the thread of the loop, which calls Step(); the camera's threads call what says so.
class RigCommands {
 public:
  using Clock = std::chrono::steady_clock;

  // `failed` is told, by whatever thread, of what was understood and then did not work.
  RigCommands(RigLoop& loop, std::function<void(const Error&)> failed);

  // Adds the camera from now on. Both must outlive the last call of this.
  void HasCamera(SceneCamera& scene, VirtualCamera& camera);

  // Fails with kInvalidArgument for a line that is no command, or not of a rig as this one is.
  [[nodiscard]] Result<RigAction> Parse(const std::string& line);
  // Does it; by the loop's thread.
  [[nodiscard]] Status Do(const std::string& line);
  // "N:COMMAND": when the Nth capture is asked for, before anything comes of it;
  // "N+TIME:COMMAND", as "5+12ms:unplug": that long after it. kInvalidArgument.
  [[nodiscard]] Status Schedule(const std::string& text);

  void Failed(const Error& error) const { failed_(error); }
  // The capture of this number is asked for. Any thread.
  void CaptureAsked(int number);
  // Hands `action` to the loop's thread. May be called from any thread.
  void Post(std::function<void()> action, Clock::time_point due = Clock::now());
  // Runs the actions that are due, in the order of time.
  void Step();

 private:
  struct Scheduled {
    std::chrono::nanoseconds after;
    RigAction action;
  };
  void Run(const RigAction& action) const;

  RigLoop& loop_;
  const std::function<void(const Error&)> failed_;
  SceneCamera* scene_ = nullptr;
  VirtualCamera* camera_ = nullptr;
  std::mutex mutex_;                         // guards all below
  std::multimap<int, Scheduled> scheduled_;  // by the capture's number
  std::multimap<Clock::time_point, std::function<void()>> posted_;
};

}  // namespace sateen
