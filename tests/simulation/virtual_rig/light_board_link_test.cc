#include <gmock/gmock.h>

#include "firmware/controller/pins.h"
#include "scanner/devices/light_board.h"
#include "simulation/virtual_rig/board/line_stress.h"
#include "simulation/virtual_rig/board/simulated_port.h"
#include "tests/simulation/virtual_rig/board_talk.h"

// The host's LightBoard and the board's real firmware, in simulated time.
namespace sateen::testing::light_board_link_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using State = LightBoard::State;

class LightBoardLink : public BoardTest {
 protected:
  LightBoardLink() { ConnectAnew(); }

  void ConnectAnew(bool opening_resets = false) {
    host_.emplace(std::make_unique<SimulatedPort>(*board_, LineFaults{}, opening_resets));
    const Status connected = host_->Connect();
    ASSERT_TRUE(connected) << connected.error().message;
  }

  // Expects that the lights which the host believes to be on are those that shine.
  void ExpectTruth() {
    const Result<BoardReport> report = host_->Report();
    ASSERT_TRUE(report) << report.error().message;
    unsigned lit = 0;
    for (const int light : board_->Lit()) {
      lit |= 1U << light;
    }
    EXPECT_EQ(report->state.lit, lit);
  }

  std::optional<LightBoard> host_;
};

TEST_F(LightBoardLink, EveryCommandDoesWhatItSays) {
  EXPECT_EQ(host_->Info().lights.size(), size_t{SATEEN_CHANNELS});
  EXPECT_EQ(host_->SetLight(3, 0.5, milliseconds(500))->lit, 1U << 3);
  EXPECT_DOUBLE_EQ(board_->Level(3), 0.5);
  EXPECT_EQ(host_->Report()->state.lit, 1U << 3);
  EXPECT_EQ(host_->AllOff()->lit, 0U);
  EXPECT_THAT(board_->Lit(), IsEmpty());
  EXPECT_EQ(host_->Arm(2, 0.25, milliseconds(40))->armed, 2);
  board_->FlashSync(true);
  board_->RunFor(milliseconds(1));
  EXPECT_DOUBLE_EQ(board_->Level(2), 0.25);
  board_->FlashSync(false);
  EXPECT_GT(host_->TriggerShutter(milliseconds(100))->shutter, milliseconds(90));
  EXPECT_TRUE(board_->ShutterClosed());
  ASSERT_TRUE(host_->Limit(4, {.max_level = 0.4, .max_on = milliseconds(700)}));
  may_[4] = {.on = milliseconds(700), .level = 0.4};
  EXPECT_EQ(host_->SetLight(4, 0.5, milliseconds(1)).error().code, ErrorCode::kInvalidArgument);
  ASSERT_TRUE(host_->Configure({.max_lit = 2}));
  may_be_lit_ = 2;
  ASSERT_TRUE(host_->SetLight(0, 0.3, milliseconds(1000)));
  EXPECT_EQ(host_->SetLight(1, 0.3, milliseconds(1000), true)->lit, 3U);
  ExpectTruth();
}

TEST_F(LightBoardLink, AKilledHostLeavesNoLightOn) {
  ASSERT_TRUE(host_->SetLight(9, 1.0, milliseconds(10'000)));
  const SimTime killed = board_->Now();  // from here on nothing is sent
  SimTime off{};
  board_->Watch({.light = [&](const LightChange& change) { off = change.time; }});

  board_->RunFor(seconds(3));

  EXPECT_THAT(board_->Lit(), IsEmpty());
  EXPECT_LT(off - killed, milliseconds(2100));
  fmt::print("host killed: off after {:.3f} s\n",
             std::chrono::duration<double>(off - killed).count());
  EXPECT_EQ(host_->Report()->state.fault, SATEEN_FAULT_HOST_SILENT);
}

TEST_F(LightBoardLink, AHangIsReportedWithItsCause) {
  host_.reset();  // it says all off to the board that it knows
  Start(TestFirmware());
  ConnectAnew();
  ASSERT_TRUE(host_->SetLight(7, 1.0, milliseconds(5000)));
  ASSERT_TRUE(host_->Hang(false));
  board_->RunFor(milliseconds(300));
  EXPECT_THAT(board_->Lit(), IsEmpty());

  const Result<BoardState> late = host_->SetLight(8, 1.0, milliseconds(5000));

  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::kDevice);
  EXPECT_EQ(host_->state(), State::kRestarted);
  EXPECT_THAT(board_->Lit(), IsEmpty());  // the command was not done behind the host's back
  ASSERT_TRUE(host_->Connect());
  EXPECT_THAT(host_->Info().reset_cause, HasSubstr("watchdog"));
  EXPECT_EQ(host_->Info().fault, SATEEN_FAULT_WATCHDOG);
}

// The port dies, the board with it, 40 us further into the exchange of a command each time.
TEST_F(LightBoardLink, UnpluggedAtEachMomentOfACommandAndPluggedInAgain) {
  SimTime slowest{};
  for (int us = 0; us < 1400; us += 40) {
    ASSERT_TRUE(host_->SetLight(1, 0.5, milliseconds(9000)));
    board_->At(board_->Now() + microseconds(us), [&] { board_->Unplug(); });

    const Result<BoardState> state = host_->SetLight(2, 0.5, milliseconds(9000));
    board_->RunFor(milliseconds(2));

    EXPECT_THAT(board_->Lit(), IsEmpty());
    if (!state) {
      EXPECT_EQ(state.error().code, ErrorCode::kDevice);
      EXPECT_EQ(host_->state(), State::kLost);
    }
    ASSERT_FALSE(host_->Report());  // whatever came of the command, now it is known
    EXPECT_EQ(host_->state(), State::kLost);
    ASSERT_FALSE(host_->SetLight(3, 0.5, milliseconds(9000)));
    board_->At(board_->Now() + milliseconds(300), [&] { board_->Plug(); });
    const SimTime plugged = board_->Now() + milliseconds(300);
    ASSERT_TRUE(host_->Connect());
    slowest = std::max(slowest, board_->Now() - plugged);
    EXPECT_THAT(board_->Lit(), IsEmpty());
    ExpectTruth();
  }
  EXPECT_LT(slowest, seconds(1));
  fmt::print("unplugged in a command: the link is back {:.3f} s after it is plugged in again\n",
             std::chrono::duration<double>(slowest).count());
}

TEST_F(LightBoardLink, ResetAtEachMomentOfACommand) {
  for (int us = 0; us < 1400; us += 40) {
    ASSERT_TRUE(host_->SetLight(1, 0.5, milliseconds(9000)));
    board_->At(board_->Now() + microseconds(us), [&] { board_->Reset(); });

    const Result<BoardState> state = host_->SetLight(2, 0.5, milliseconds(9000));
    board_->RunFor(milliseconds(20));

    // Done before the reset or not done: light 2 is not on, and the host finds out with its next
    // command at the latest.
    EXPECT_THAT(board_->Lit(), IsEmpty());
    const Result<BoardState> next = state ? host_->SetLight(3, 0.5, milliseconds(9000)) : state;
    EXPECT_FALSE(next) << us;
    EXPECT_EQ(host_->state(), State::kRestarted);
    EXPECT_THAT(board_->Lit(), IsEmpty());
    ASSERT_TRUE(host_->Connect());
    ExpectTruth();
  }
}

TEST_F(LightBoardLink, UnpluggedAndPluggedInAgainInEachState) {
  const auto replug = [&] {
    board_->Unplug();
    board_->RunFor(milliseconds(700));
    board_->Plug();
    return board_->Now();
  };
  const auto expect_back = [&](SimTime plugged, const char* state) {
    ASSERT_TRUE(host_->Connect()) << state;
    EXPECT_LT(board_->Now() - plugged, seconds(1)) << state;
    EXPECT_EQ(host_->state(), State::kReady);
    EXPECT_EQ(host_->Info().fault, SATEEN_FAULT_NONE);
    ExpectTruth();
    ASSERT_TRUE(host_->SetLight(0, 0.5, milliseconds(100)));
    EXPECT_THAT(board_->Lit(), ElementsAre(0));
  };

  // kReady, also with a light on, and armed: the next command says that the port is gone.
  ASSERT_TRUE(host_->Arm(5, 1.0, milliseconds(500)));
  SimTime plugged = replug();
  EXPECT_EQ(host_->Report().error().code, ErrorCode::kDevice);
  EXPECT_EQ(host_->state(), State::kLost);
  expect_back(plugged, "ready");
  board_->FlashSync(true);  // armed before: forgotten
  board_->RunFor(milliseconds(1));
  EXPECT_THAT(board_->Lit(), ElementsAre(0));
  board_->FlashSync(false);

  // kLost: once more before the host has connected again.
  replug();
  EXPECT_FALSE(host_->AllOff());
  EXPECT_EQ(host_->state(), State::kLost);
  expect_back(replug(), "lost");

  // kRestarted.
  board_->Reset();
  board_->RunFor(milliseconds(20));
  EXPECT_FALSE(host_->AllOff());
  EXPECT_EQ(host_->state(), State::kRestarted);
  expect_back(replug(), "restarted");

  // kClosed.
  host_->Close();
  EXPECT_EQ(host_->state(), State::kClosed);
  expect_back(replug(), "closed");

  // In the middle of Connect.
  board_->Unplug();
  plugged = board_->Now() + milliseconds(400);
  board_->At(plugged, [&] { board_->Plug(); });
  board_->At(plugged + microseconds(300), [&] { board_->Unplug(); });
  board_->At(plugged + milliseconds(200), [&] { board_->Plug(); });
  EXPECT_FALSE(host_->Report());
  expect_back(plugged + milliseconds(200), "connecting");
}

TEST_F(LightBoardLink, AnUnoResetsWhenItsPortIsOpened) {
  host_->Close();
  const SimTime opened = board_->Now();
  ConnectAnew(/*opening_resets=*/true);

  EXPECT_GT(board_->Now() - opened, seconds(1));  // the boot loader's
  EXPECT_LT(board_->Now() - opened, milliseconds(1300));
  ExpectTruth();
}

// The full length, a million commands, is in board_stress.
TEST_F(LightBoardLink, ABadLineLightsNoWrongLight) {
  host_.reset();
  const Result<LineStressResult> result = RunLineStress(*board_, {.commands = 3000});

  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->wrong_light, 0U) << result->first_wrong;
  EXPECT_EQ(result->wrong_answer, 0U) << result->first_wrong;
  EXPECT_EQ(result->over_time, 0U);
  EXPECT_EQ(result->done + result->reported_failed, result->commands);
  EXPECT_GT(result->bad_frames, 50U);  // the line was bad
  EXPECT_GT(result->line.dropped, 50U);
  EXPECT_GT(result->line.flipped, 50U);
  EXPECT_GT(result->line.inserted, 50U);
  EXPECT_GT(result->done, result->commands * 99 / 100);
}

// A line so bad that commands fail: they are reported, and still nothing wrong shines.
TEST_F(LightBoardLink, AVeryBadLineIsReported) {
  host_.reset();
  const Result<LineStressResult> result = RunLineStress(
      *board_, {.commands = 400, .faults = {.drop = 0.008, .flip = 0.008, .insert = 0.008}});

  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->wrong_light, 0U) << result->first_wrong;
  EXPECT_EQ(result->wrong_answer, 0U) << result->first_wrong;
  EXPECT_GT(result->reported_failed, 0U);
}

}  // namespace
}  // namespace sateen::testing::light_board_link_test
