#include "scanner/daemon/file_desk.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>

#include "core/stray_thread.h"

namespace sateen {

// Shared with the threads, which may outlive the desk.
struct FileDesk::Readings {
  std::mutex mutex;
  std::condition_variable ended;
  int running = 0;
};

namespace {

struct Reading {
  std::optional<Status> outcome;  // with the mutex of the readings held
};

Status RunNoThrow(const std::function<Status()>& reading) {
  try {
    return reading();
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kIo, "internal error on reading a file: {}", error.what());
  }
}

}  // namespace

FileDesk::FileDesk() : FileDesk(Options{}) {}

FileDesk::FileDesk(const Options& options)
    : options_(options), readings_(std::make_shared<Readings>()) {}

Status FileDesk::Run(std::function<Status()> reading, const ClientLeft& left) const {
  const auto mine = std::make_shared<Reading>();
  std::unique_lock lock(readings_->mutex);
  if (readings_->running >= options_.most) {
    return Fail(ErrorCode::kDevice,
                "{} readings of files hang; is a network disk gone? bring it back, or start the "
                "daemon again",
                readings_->running);
  }
  try {
    StartStray([readings = readings_, mine, reading = std::move(reading)] {
      Status outcome = RunNoThrow(reading);
      const std::lock_guard end(readings->mutex);
      mine->outcome = std::move(outcome);
      --readings->running;
      readings->ended.notify_all();
    });
  } catch (const std::system_error& error) {
    return Fail(ErrorCode::kDevice, "no thread to read a file: {}; try again later", error.what());
  }
  ++readings_->running;
  const auto until = std::chrono::steady_clock::now() + options_.patience;
  const auto ended = [&] { return mine->outcome.has_value(); };
  while (!ended()) {
    const auto now = std::chrono::steady_clock::now();
    if (now >= until) {
      return Fail(ErrorCode::kTimeout,
                  "a file of the request was not read within {:g} s; is its disk there? try again, "
                  "or copy the file to another disk",
                  std::chrono::duration<double>(options_.patience).count());
    }
    if (left && left()) {
      return Fail(ErrorCode::kCancelled, "the client has left");
    }
    readings_->ended.wait_until(lock, std::min(until, now + kLookForClient), ended);
  }
  return *mine->outcome;
}

}  // namespace sateen
