#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "scanner/devices/rig_devices.h"

namespace sateen {

// Returns whether the client that waits for something has left; empty where there is no client.
using ClientLeft = std::function<bool()>;
// How often a wait looks whether its client has left.
inline constexpr std::chrono::milliseconds kLookForClient{100};

// Event of a job. Events are in order, and a job ends with one "done" or one "failed".
struct JobEvent {
  std::uint64_t sequence = 0;  // from 1, without gaps
  std::string type;            // "progress", "note", "done", "failed"
  std::string data;            // one line of JSON
};

enum class JobState { kRunning, kDone, kFailed };

// Record of a job. `owner` tells another person whom to talk to.
struct JobRecord {
  std::uint64_t id = 0;
  std::string kind;   // "capture", "light", "devices", "board", "lights off", "solve"
  std::string what;   // the folder of a capture, the light
  std::string owner;  // client that asked: "process 4711 (sateen) of alice"
  std::chrono::system_clock::time_point since;
  std::optional<std::chrono::system_clock::time_point> ended;
  JobState state = JobState::kRunning;
  std::string result;          // JSON; only of a job that is done
  std::optional<Error> error;  // error of a failed job; kCancelled: somebody cancelled it
  std::uint64_t last_event = 0;
  bool has_rig = true;  // whether it has board and camera to itself
};

// The means of a job's work. All but Report() is for the job's own thread.
class JobContext {
 public:
  virtual ~JobContext() = default;
  // Returns board and camera; only for a job that has the rig.
  [[nodiscard]] virtual RigDevices& Devices() = 0;
  [[nodiscard]] virtual const Task& GetTask() const = 0;
  // Sends one line of JSON to those who follow the job. From any thread.
  virtual void Report(std::string json) = 0;
  // Records, before a light goes on, the channels that may be on from now on.
  virtual void Lit(std::vector<int> channels) = 0;
};

// Does the job and returns its result as JSON. Stops with kCancelled soon after the task's flag is
// set.
using JobWork = std::function<Result<std::string>(JobContext&)>;

struct JobRequest {
  std::string kind;
  std::string what;
  std::string owner;
  // False: the job needs neither board nor camera, and runs beside one that has the rig.
  bool needs_rig = true;
  // True: where another job has the rig, this one is the next to get it.
  bool urgent = false;
  JobWork work;
};

}  // namespace sateen
