#include <gmock/gmock.h>

#include "firmware/controller/pins.h"
#include "tests/simulation/virtual_rig/board_talk.h"

// Limits that the firmware lets no host exceed, whatever it sends. BoardTest watches all lights
// meanwhile.
namespace sateen::testing::firmware_limits_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class FirmwareLimits : public BoardTest {
 protected:
  FirmwareLimits() { talk_->Hello(); }

  SateenState Limit(int channel, int permille, int on_ms) {
    may_[static_cast<size_t>(channel)] = {.on = milliseconds(on_ms), .level = permille / 1000.0};
    return talk_->Do(SateenLimitLight{.channel = static_cast<uint8_t>(channel),
                                      .max_level_permille = static_cast<uint16_t>(permille),
                                      .max_on_ms = static_cast<uint16_t>(on_ms)});
  }
  SateenState Configure(int max_lit) {
    may_be_lit_ = static_cast<size_t>(max_lit);
    return talk_->Do(SateenConfigure{.max_lit = static_cast<uint8_t>(max_lit)});
  }
  // Keeps the host from being silent.
  void StayFor(milliseconds time) {
    for (milliseconds passed(0); passed < time; passed += milliseconds(500)) {
      board_->RunFor(milliseconds(499));
      talk_->Status();
    }
  }
};

TEST_F(FirmwareLimits, NoLevelAboveTheLimitOfThatLight) {
  for (int k = 0; k < SATEEN_CHANNELS; ++k) {
    ASSERT_EQ(Limit(k, 100 + 10 * k, 1000).result, SATEEN_RESULT_DONE);
  }
  for (int k = 0; k < SATEEN_CHANNELS; ++k) {
    EXPECT_EQ(talk_->Light(k, 101 + 10 * k, 100).result, SATEEN_RESULT_OVER_LIMIT);
    EXPECT_THAT(board_->Lit(), IsEmpty());
    EXPECT_EQ(talk_->Light(k, 100 + 10 * k, 100).result, SATEEN_RESULT_DONE);
    EXPECT_THAT(board_->Lit(), ElementsAre(k));
    EXPECT_EQ(talk_
                  ->Do(SateenArm{.channel = static_cast<uint8_t>(k),
                                 .level_permille = static_cast<uint16_t>(101 + 10 * k),
                                 .on_ms = 100})
                  .result,
              SATEEN_RESULT_OVER_LIMIT);
    talk_->Do(SateenAllOff{});
  }
}

TEST_F(FirmwareLimits, NoOnTimeAboveTheLimitOfThatLight) {
  Limit(3, 1000, 250);

  EXPECT_EQ(talk_->Light(3, 1000, 251).result, SATEEN_RESULT_OVER_LIMIT);
  EXPECT_EQ(talk_->Do(SateenArm{.channel = 3, .level_permille = 1000, .on_ms = 251}).result,
            SATEEN_RESULT_OVER_LIMIT);
  EXPECT_EQ(talk_->Light(2, 1000, 251).result, SATEEN_RESULT_DONE);
  EXPECT_EQ(talk_->Light(3, 1000, 250).result, SATEEN_RESULT_DONE);
  board_->RunFor(milliseconds(251));
  EXPECT_THAT(board_->Lit(), IsEmpty());
  EXPECT_EQ(talk_->Status().fault, SATEEN_FAULT_NONE);  // it went off when it was told to
}

TEST_F(FirmwareLimits, ALightGoesOffAfterItsTimeToTheMillisecond) {
  for (const int on_ms : {1, 2, 10, 333}) {
    board_->ClearRecords();
    talk_->Light(8, 500, on_ms);
    board_->RunFor(milliseconds(on_ms + 1));

    EXPECT_THAT(board_->Lit(), IsEmpty());
    const SimTime on = board_->Records()[8].longest_on;
    EXPECT_LE(on, milliseconds(on_ms));
    EXPECT_GT(on, milliseconds(on_ms - 1));
  }
}

TEST_F(FirmwareLimits, CommandsOverAndOverDoNotStretchTheOnTime) {
  Limit(5, 1000, 300);
  board_->ClearRecords();

  int refused = 0;
  for (int i = 0; i < 100; ++i) {
    const SateenState state = talk_->Light(5, 1 + i, 300);  // a new level, a new time
    refused += state.result != SATEEN_RESULT_DONE ? 1 : 0;
    board_->RunFor(milliseconds(9));
  }

  EXPECT_LE(board_->Records()[5].longest_on, milliseconds(300));
  EXPECT_EQ(board_->Records()[5].times_on, 1);  // not again before the fault is cleared
  EXPECT_GT(refused, 60);
  EXPECT_EQ(talk_->Status().fault, SATEEN_FAULT_ON_TIME_LIMIT);
  EXPECT_TRUE(talk_->TakeUnasked<SateenFault>());
  talk_->Do(SateenClearFault{.fault = SATEEN_FAULT_ON_TIME_LIMIT});
  EXPECT_EQ(talk_->Light(5, 1000, 300).result, SATEEN_RESULT_DONE);
}

TEST_F(FirmwareLimits, EachTimeOnHasTheWholeLimit) {
  Limit(5, 1000, 300);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(talk_->Light(5, 1000, 250).lit, 1 << 5);
    board_->RunFor(milliseconds(240));
    EXPECT_THAT(board_->Lit(), ElementsAre(5));
    EXPECT_LT(talk_->Status().lit_ms, 245);
    board_->RunFor(milliseconds(20));
    EXPECT_THAT(board_->Lit(), IsEmpty());
  }
  EXPECT_EQ(talk_->Status().fault, SATEEN_FAULT_NONE);
}

TEST_F(FirmwareLimits, OneLightAtATimeUnlessConfiguredOtherwise) {
  talk_->Light(0, 400, 3000);
  EXPECT_EQ(talk_->Light(1, 400, 3000, /*add=*/true).result, SATEEN_RESULT_TOO_MANY_LIT);
  EXPECT_THAT(board_->Lit(), ElementsAre(0));

  Configure(3);

  talk_->Light(0, 400, 3000);
  EXPECT_EQ(talk_->Light(1, 400, 3000, true).result, SATEEN_RESULT_DONE);
  EXPECT_EQ(talk_->Light(2, 400, 2000, true).result, SATEEN_RESULT_DONE);
  EXPECT_EQ(talk_->Light(3, 400, 3000, true).result, SATEEN_RESULT_TOO_MANY_LIT);
  EXPECT_EQ(talk_->Light(1, 500, 3000, true).result, SATEEN_RESULT_OTHER_LEVEL);
  EXPECT_THAT(board_->Lit(), ElementsAre(0, 1, 2));
  // Each goes off after its own time.
  StayFor(milliseconds(2100));
  EXPECT_THAT(board_->Lit(), ElementsAre(0, 1));
  // Without `add` the others make room.
  EXPECT_EQ(talk_->Light(9, 700, 100).lit, 1 << 9);
  EXPECT_THAT(board_->Lit(), ElementsAre(9));
}

TEST_F(FirmwareLimits, ValuesOutOfRangeChangeNothing) {
  const int channels = SATEEN_CHANNELS;
  EXPECT_EQ(talk_->Light(channels, 100, 100).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Light(255, 100, 100).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Light(0, 1001, 100).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Light(0, 65535, 100).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Light(0, 100, 0).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Light(0, 100, 65535).result, SATEEN_RESULT_OVER_LIMIT);
  EXPECT_EQ(talk_->Do(SateenSetLight{.level_permille = 100, .on_ms = 100, .add = 2}).result,
            SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenArm{.channel = 14, .level_permille = 1, .on_ms = 1}).result,
            SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenArm{.level_permille = 0, .on_ms = 1}).result,
            SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenTriggerShutter{.press_ms = 0}).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenTriggerShutter{.press_ms = 10'001}).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenLimitLight{.channel = 14, .max_on_ms = 1}).result,
            SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenLimitLight{.max_level_permille = 1001, .max_on_ms = 1}).result,
            SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenLimitLight{.max_on_ms = 0}).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenLimitLight{.max_on_ms = 60'001}).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenConfigure{.max_lit = 0}).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenConfigure{.max_lit = 15}).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenConfigure{.max_lit = 1, .dim_clock = 3}).result,
            SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_EQ(talk_->Do(SateenConfigure{.max_lit = 1, .sync_edge = 2}).result,
            SATEEN_RESULT_OUT_OF_RANGE);
  for (const ChannelRecord& record : board_->Records()) {
    EXPECT_EQ(record.times_on, 0);
  }
  const SateenGreeting greeting = talk_->Hello();
  EXPECT_EQ(greeting.max_lit, 1);
  EXPECT_EQ(greeting.max_on_ms[0], 10'000);
}

TEST_F(FirmwareLimits, AllGoesOffWhenTheHostHasBeenSilentForTwoSeconds) {
  talk_->Light(4, 1000, 10'000);
  const SimTime heard = board_->Now();
  SimTime off{};
  board_->Watch({.light = [&](const LightChange& change) { off = change.time; }});

  board_->RunFor(milliseconds(2500));

  EXPECT_THAT(board_->Lit(), IsEmpty());
  EXPECT_LT(off - heard, milliseconds(2100));
  EXPECT_GT(off - heard, milliseconds(1990));
  fmt::print("host silent: off after {:.3f} s\n",
             std::chrono::duration<double>(off - heard).count());
  const auto fault = talk_->TakeUnasked<SateenFault>();
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->fault, SATEEN_FAULT_HOST_SILENT);
  EXPECT_EQ(fault->lit, 1 << 4);
}

TEST_F(FirmwareLimits, SilenceDisarmsWhereNothingElseIsOn) {
  talk_->Do(SateenArm{.channel = 4, .level_permille = 1000, .on_ms = 1000});
  board_->RunFor(milliseconds(2100));

  board_->FlashSync(true);
  board_->RunFor(milliseconds(10));
  EXPECT_EQ(board_->Records()[4].times_on, 0);
}

TEST_F(FirmwareLimits, SilenceDisarmsAndOpensTheShutter) {
  talk_->Do(SateenArm{.channel = 4, .level_permille = 1000, .on_ms = 1000});
  talk_->Do(SateenTriggerShutter{.press_ms = 10'000});
  board_->RunFor(milliseconds(2100));

  EXPECT_FALSE(board_->ShutterClosed());
  board_->FlashSync(true);
  board_->RunFor(milliseconds(10));
  EXPECT_EQ(board_->Records()[4].times_on, 0);
}

TEST_F(FirmwareLimits, AnyGoodFrameKeepsALightOnAndABadOneDoesNot) {
  talk_->Light(4, 1000, 10'000);
  StayFor(milliseconds(5000));
  EXPECT_THAT(board_->Lit(), ElementsAre(4));

  std::vector<uint8_t> bad = Encode(200, SATEEN_STATUS);
  bad[3] ^= 0x10;
  for (int i = 0; i < 25; ++i) {
    talk_->SendAndListen(bad, milliseconds(100));
  }
  EXPECT_THAT(board_->Lit(), IsEmpty());
}

}  // namespace
}  // namespace sateen::testing::firmware_limits_test
