#pragma once

#include <gmock/gmock.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "scanner/daemon/answer_json.h"
#include "scanner/daemon/api.h"
#include "scanner/daemon/rig_jobs.h"
#include "scanner/daemon/rig_service.h"
#include "tests/scanner/devices/fake_board.h"

namespace sateen::testing {

inline constexpr std::chrono::milliseconds kLong{60'000};  // no test waits for so long

class FakeCamera : public TetheredCamera {
 public:
  Result<CameraInfo> Open() override {
    return CameraInfo{.model = "fake camera", .port = "fake:", .profile = "fake"};
  }
  Result<ExposureSettings> Configure(const ExposureSettings& settings) override { return settings; }
  [[nodiscard]] std::vector<double> ExposureTimes() const override { return {}; }
  Result<CapturedFile> Capture(const std::filesystem::path& /*folder*/,
                               std::chrono::milliseconds /*deadline*/) override {
    return Fail(ErrorCode::kDevice, "the fake camera takes no frames");
  }
  void Close() noexcept override {}
};

// A board in simulated time that stands still while `held`, so that a light stays on until somebody
// cancels. Look at the board only while no job runs.
struct FakeRig {
  FakeBoard board;
  std::atomic<bool> held = true;

  std::unique_ptr<RigDevices> Devices() {
    auto port = std::make_unique<HeldPort>(*this);
    return std::make_unique<RigDevices>(std::move(port), std::make_unique<FakeCamera>());
  }

 private:
  class HeldPort : public FakePort {
   public:
    explicit HeldPort(FakeRig& rig) : FakePort(rig.board), rig_(rig) {}
    void Wait(Duration time) override {
      if (rig_.held) {
        std::this_thread::yield();
      } else {
        FakePort::Wait(time);
      }
    }

   private:
    FakeRig& rig_;
  };
};

inline JobRequest WorkJob(JobWork work, std::string owner = "alice") {
  return {.kind = "test", .what = "nothing", .owner = std::move(owner), .work = std::move(work)};
}

// All events of a job, once it has ended; those that there are if no more come for kLong.
inline std::vector<JobEvent> AllEvents(const RigService& service, std::uint64_t id) {
  std::vector<JobEvent> events;
  while (true) {
    const auto followed = service.Follow(id, events.empty() ? 0 : events.back().sequence, kLong);
    if (!followed) {
      return events;
    }
    events.insert(events.end(), followed->events.begin(), followed->events.end());
    if (followed->ended || followed->events.empty()) {
      return events;
    }
  }
}

// A rig and its service, with the API over it.
struct FakeDaemon {
  FakeRig rig;
  RigService service{rig.Devices()};
  Api api{service, {.version = "1.2.3"}};

  ApiResponse Ask(const std::string& method, const std::string& path, const std::string& body = "",
                  const std::string& who = "a test") const {
    return api.Handle({.method = method, .path = path, .body = body, .who = who});
  }
  // A light that is on until it is cancelled; its job.
  std::uint64_t TurnOn(int channel, const std::string& owner = "alice") {
    const auto id = service.Begin(LightJob({.channel = channel, .level = 0.5}, owner));
    EXPECT_TRUE(id.has_value());
    EXPECT_EQ(service.Follow(*id, 0, kLong)->events.at(0).type, "progress");
    return *id;
  }
};

}  // namespace sateen::testing
