#include "simulation/virtual_rig/rig_loop.h"

#include <gmock/gmock.h>

#include <thread>

#include "tests/simulation/virtual_rig/board_talk.h"

namespace sateen::testing::rig_loop_test {
namespace {

using Clock = std::chrono::steady_clock;

class RigLoopTest : public BoardTest {
 protected:
  RigLoopTest() : log_(board_->LightCount()) {
    talk_->Hello();
    port_.emplace(*VirtualPort::Open({}, std::nullopt));
    loop_.emplace(*board_, *port_, RigLoopOptions{.light_log = &log_});
    loop_->Start("firmware", {});
  }
  ~RigLoopTest() override { loop_.reset(); }

  // As the host would, and then the loop runs until the light is on.
  void LightUp(uint8_t channel, uint16_t on_ms) {
    board_->Send(Encode(
        77, Wire<SateenSetLight>::kId,
        Wire<SateenSetLight>::Pack({.channel = channel, .level_permille = 1000, .on_ms = on_ms})));
    bool seen = false;  // it may be off again after one step of a busy machine
    const int watch = board_->Watch({.light = [&seen](const LightChange&) { seen = true; }});
    while (!seen) {
      loop_->Step();
    }
    board_->Unwatch(watch);
  }

  LightLog log_;
  std::optional<VirtualPort> port_;
  std::optional<RigLoop> loop_;
};

TEST_F(RigLoopTest, TheLogKnowsALightByTheWallClock) {
  const Clock::time_point before = Clock::now();
  LightUp(3, /*on_ms=*/2);
  while (board_->Level(3) > 0) {
    loop_->Step();
  }
  loop_->Step();
  const Clock::time_point after = Clock::now();
  loop_->Step();
  while (!log_.MeanLevels(before, after, milliseconds(0))) {
    loop_->Step();  // until the board has come as far
  }
  const double on_ms = log_.MeanLevels(before, after)->at(3) *
                       std::chrono::duration<double, std::milli>(after - before).count();
  // Longer only where the machine kept the loop from running.
  EXPECT_GT(on_ms, 0.9);
  EXPECT_EQ(log_.MeanLevels(before, after)->at(4), 0.0);
}

TEST_F(RigLoopTest, WhileTheLoopIsKeptFromRunningALightStaysAsItIs) {
  LightUp(3, /*on_ms=*/150);
  const Clock::time_point begin = Clock::now();
  std::this_thread::sleep_for(milliseconds(200));  // the machine was busy with something else
  const Clock::time_point end = Clock::now();
  while (board_->Level(3) > 0) {
    loop_->Step();
  }
  // Its 150 ms were not over then: that time did not pass for the board.
  const auto means = log_.MeanLevels(begin, end);
  ASSERT_TRUE(means) << means.error().message;
  EXPECT_EQ(means->at(3), 1.0);
}

}  // namespace
}  // namespace sateen::testing::rig_loop_test
