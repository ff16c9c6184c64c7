#include <gmock/gmock.h>

#include <set>

#include "firmware/controller/pins.h"
#include "tests/simulation/virtual_rig/board_talk.h"

// Effects of each message of the protocol on the real firmware and on its outputs.
namespace sateen::testing::firmware_messages_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

using FirmwareMessages = BoardTest;

TEST_F(FirmwareMessages, GreetsUnaskedWhenItStarts) {
  board_->Reset();
  board_->RunFor(milliseconds(20));

  const auto greeting = talk_->TakeUnasked<SateenGreeting>();

  ASSERT_TRUE(greeting);
  EXPECT_EQ(greeting->protocol_major, SATEEN_PROTOCOL_MAJOR);
  EXPECT_EQ(greeting->reset_cause, SATEEN_RESET_EXTERNAL);
}

TEST_F(FirmwareMessages, HelloTellsWhatTheBoardIs) {
  const SateenGreeting greeting = talk_->Hello();

  EXPECT_EQ(greeting.channels, SATEEN_CHANNELS);
  EXPECT_EQ(greeting.channels, board_->LightCount());
  EXPECT_EQ(greeting.max_lit, 1);
  EXPECT_EQ(greeting.silence_ms, 2000);
  EXPECT_EQ(greeting.reset_cause, SATEEN_RESET_POWER_ON);
  EXPECT_EQ(greeting.fault, SATEEN_FAULT_NONE);
  for (int k = 0; k < SATEEN_CHANNELS; ++k) {
    EXPECT_EQ(greeting.max_level_permille[k], 1000);
    EXPECT_EQ(greeting.max_on_ms[k], 10'000);
  }
}

TEST_F(FirmwareMessages, HelloTurnsEverythingOff) {
  talk_->Hello();
  talk_->Light(4, 700, 5000);
  ASSERT_THAT(board_->Lit(), ElementsAre(4));

  talk_->Hello();

  EXPECT_THAT(board_->Lit(), IsEmpty());
}

TEST_F(FirmwareMessages, RefusesAnotherProtocol) {
  const auto greeting = talk_->Ask<SateenGreeting>(SateenHello{.protocol_major = 9});

  EXPECT_EQ(greeting.protocol_major, SATEEN_PROTOCOL_MAJOR);  // the host reads and decides
  EXPECT_EQ(talk_->Light(0, 1000, 100).result, SATEEN_RESULT_NOT_GREETED);
  EXPECT_THAT(board_->Lit(), IsEmpty());
}

TEST_F(FirmwareMessages, WithoutHelloOnlyStatusAndAllOffAreDone) {
  EXPECT_EQ(talk_->Light(0, 1000, 100).result, SATEEN_RESULT_NOT_GREETED);
  EXPECT_EQ(talk_->Do(SateenArm{.level_permille = 1000, .on_ms = 100}).result,
            SATEEN_RESULT_NOT_GREETED);
  EXPECT_EQ(talk_->Do(SateenTriggerShutter{.press_ms = 10}).result, SATEEN_RESULT_NOT_GREETED);
  EXPECT_EQ(talk_->Do(SateenLimitLight{.max_on_ms = 10}).result, SATEEN_RESULT_NOT_GREETED);
  EXPECT_EQ(talk_->Do(SateenConfigure{.max_lit = 2}).result, SATEEN_RESULT_NOT_GREETED);
  EXPECT_EQ(talk_->Do(SateenClearFault{}).result, SATEEN_RESULT_NOT_GREETED);
  EXPECT_EQ(talk_->Do(SateenAllOff{}).result, SATEEN_RESULT_DONE);
  EXPECT_EQ(talk_->Status().result, SATEEN_RESULT_DONE);
  EXPECT_EQ(board_->Records()[0].times_on, 0);
}

// The pins are those that docs/rig.md tells people to solder.
TEST_F(FirmwareMessages, EachLightIsOnThePinOfTheManual) {
  const std::vector<ChipPin> lights = {
      {'D', 3}, {'D', 4}, {'D', 5}, {'D', 6}, {'D', 7}, {'B', 0}, {'B', 2},   // D3 ... D8, D10
      {'B', 3}, {'B', 4}, {'C', 0}, {'C', 1}, {'C', 2}, {'C', 3}, {'C', 4}};  // D11, D12, A0 ... A4
  talk_->Hello();
  for (int k = 0; k < SATEEN_CHANNELS; ++k) {
    talk_->Light(k, 1000, 1000);
    for (const ChipPin& pin : lights) {
      EXPECT_EQ(board_->InnerChip().Drives(pin), pin == lights[static_cast<size_t>(k)]);
    }
  }
  talk_->Do(SateenTriggerShutter{.press_ms = 10});
  EXPECT_TRUE(board_->InnerChip().Drives({'C', 5}));  // A5
}

// Two lights more, on the pins of flash sync and shutter, which it then does not have.
TEST_F(FirmwareMessages, WithSixteenLightsTheLastTwoAreOnA5AndD2) {
  Start(FirmwareFor16Lights(), ControllerWiring(16));
  const SateenGreeting greeting = talk_->Hello();
  EXPECT_EQ(greeting.channels, 16);
  EXPECT_EQ(greeting.max_on_ms[15], 10'000);

  for (int k = 0; k < 16; ++k) {
    const SateenState state = talk_->Light(k, 400, 1000);
    EXPECT_EQ(state.lit, 1 << k);
    EXPECT_THAT(board_->Lit(), ElementsAre(k));
    EXPECT_DOUBLE_EQ(board_->Level(k), 0.4);
    EXPECT_EQ(board_->InnerChip().Drives({'C', 5}), k == 14);  // A5
    EXPECT_EQ(board_->InnerChip().Drives({'D', 2}), k == 15);  // D2
  }
  EXPECT_EQ(talk_->Do(SateenArm{.channel = 15, .level_permille = 400, .on_ms = 100}).result,
            SATEEN_RESULT_UNKNOWN_MESSAGE);
  EXPECT_EQ(talk_->Do(SateenTriggerShutter{.press_ms = 10}).result, SATEEN_RESULT_UNKNOWN_MESSAGE);
  EXPECT_EQ(talk_->Light(16, 400, 1000).result, SATEEN_RESULT_OUT_OF_RANGE);
  EXPECT_THAT(board_->Lit(), ElementsAre(15));  // refused commands change nothing

  board_->RunFor(milliseconds(1001));
  EXPECT_THAT(board_->Lit(), IsEmpty());
  talk_->Light(15, 400, 1000);
  EXPECT_EQ(talk_->Do(SateenAllOff{}).lit, 0);
  for (const ChipPin& pin : ControllerWiring(16).lights) {
    EXPECT_FALSE(board_->InnerChip().Drives(pin)) << pin.port << pin.bit;
  }

  talk_->Light(14, 400, 1000);
  board_->Reset();
  EXPECT_THAT(board_->Lit(), IsEmpty());
  EXPECT_FALSE(board_->InnerChip().Drives({'C', 5}));
}

TEST_F(FirmwareMessages, EachChannelIsItsOwnLight) {
  talk_->Hello();
  for (int k = 0; k < SATEEN_CHANNELS; ++k) {
    const SateenState state = talk_->Light(k, 500, 1000);

    EXPECT_EQ(state.result, SATEEN_RESULT_DONE);
    EXPECT_EQ(state.lit, 1 << k);
    EXPECT_THAT(board_->Lit(), ElementsAre(k));
    EXPECT_DOUBLE_EQ(board_->Level(k), 0.5);
  }
}

TEST_F(FirmwareMessages, TheLevelIsTheShareOfThePeriodAtEachDimClock) {
  talk_->Hello();
  for (const int clock : {0, 1, 2}) {
    talk_->Do(SateenConfigure{.max_lit = 1, .dim_clock = static_cast<uint8_t>(clock)});
    for (const int permille : {1, 2, 255, 256, 257, 500, 512, 768, 999, 1000}) {
      const SateenState state = talk_->Light(7, permille, 1000);

      EXPECT_EQ(state.level_permille, permille);
      EXPECT_DOUBLE_EQ(board_->Level(7), permille / 1000.0) << "clock " << clock;
    }
  }
}

TEST_F(FirmwareMessages, LevelNoughtTurnsTheLightOff) {
  talk_->Hello();
  talk_->Light(2, 1000, 5000);

  const SateenState state = talk_->Light(2, 0, 0);

  EXPECT_EQ(state.result, SATEEN_RESULT_DONE);
  EXPECT_EQ(state.lit, 0);
  EXPECT_EQ(state.level_permille, 0);
  EXPECT_THAT(board_->Lit(), IsEmpty());
}

TEST_F(FirmwareMessages, AllOffTurnsOffDisarmsAndOpensTheShutter) {
  talk_->Hello();
  talk_->Do(SateenArm{.channel = 3, .level_permille = 800, .on_ms = 100});
  talk_->Do(SateenTriggerShutter{.press_ms = 5000});
  ASSERT_TRUE(board_->ShutterClosed());

  const SateenState state = talk_->Do(SateenAllOff{});

  EXPECT_EQ(state.armed, SATEEN_NO_CHANNEL);
  EXPECT_EQ(state.shutter_ms, 0);
  EXPECT_FALSE(board_->ShutterClosed());
  board_->FlashSync(true);
  board_->RunFor(milliseconds(5));
  EXPECT_THAT(board_->Lit(), IsEmpty());
}

TEST_F(FirmwareMessages, StatusTellsWhatIsLitAndSinceWhen) {
  talk_->Hello();
  talk_->Light(5, 250, 3000);
  board_->RunFor(milliseconds(700));

  const SateenReport report = talk_->Status();

  EXPECT_EQ(report.lit, 1 << 5);
  EXPECT_EQ(report.level_permille, 250);
  EXPECT_NEAR(report.lit_ms, 700, 3);  // and the way of the frames
  EXPECT_NEAR(report.left_ms, 2300, 3);
  EXPECT_NEAR(report.uptime_ms, 720, 5);
  EXPECT_EQ(report.reset_cause, SATEEN_RESET_POWER_ON);
  EXPECT_EQ(report.frames, 3U);
  EXPECT_EQ(report.bad_frames, 0);
  EXPECT_EQ(report.overruns, 0);
}

TEST_F(FirmwareMessages, TheFlashSyncFiresAnArmedLightOnceAndItGoesOff) {
  talk_->Hello();
  talk_->Do(SateenArm{.channel = 6, .level_permille = 900, .on_ms = 30});
  EXPECT_THAT(board_->Lit(), IsEmpty());
  const SimTime closed = board_->Now();
  std::vector<LightChange> changes;
  board_->Watch({.light = [&](const LightChange& change) { changes.push_back(change); }});

  board_->FlashSync(true);
  board_->RunFor(milliseconds(50));
  board_->FlashSync(false);
  board_->RunFor(milliseconds(1));
  board_->FlashSync(true);  // the camera's next frame: nothing is armed
  board_->RunFor(milliseconds(50));
  board_->FlashSync(false);

  ASSERT_EQ(changes.size(), 2U);
  EXPECT_EQ(changes[0].light, 6);
  EXPECT_DOUBLE_EQ(changes[0].level, 0.9);
  // The camera opens its shutter fully before it closes the contact: light follows at once.
  EXPECT_LT(changes[0].time - closed, microseconds(50));
  EXPECT_LE(changes[1].time - changes[0].time, milliseconds(30));
  EXPECT_GE(changes[1].time - changes[0].time, milliseconds(29));
  const SateenReport report = talk_->Status();
  EXPECT_EQ(report.syncs, 2);
  EXPECT_EQ(report.flashes, 1);
  EXPECT_EQ(report.armed, SATEEN_NO_CHANNEL);
}

TEST_F(FirmwareMessages, TheSyncEdgeCanBeRising) {
  talk_->Hello();
  talk_->Do(SateenConfigure{.max_lit = 1, .sync_edge = 1});
  talk_->Do(SateenArm{.channel = 1, .level_permille = 400, .on_ms = 30});

  board_->FlashSync(true);
  board_->RunFor(milliseconds(2));
  EXPECT_THAT(board_->Lit(), IsEmpty());
  board_->FlashSync(false);
  board_->RunFor(milliseconds(2));
  EXPECT_THAT(board_->Lit(), ElementsAre(1));
}

TEST_F(FirmwareMessages, TriggerShutterClosesTheContactForSoLong) {
  talk_->Hello();
  std::vector<SimTime> changes;
  board_->Watch({.shutter = [&](SimTime time, bool) { changes.push_back(time); }});

  talk_->Do(SateenTriggerShutter{.press_ms = 120});
  board_->RunFor(milliseconds(200));

  ASSERT_EQ(changes.size(), 2U);
  EXPECT_LE(changes[1] - changes[0], milliseconds(120));
  EXPECT_GE(changes[1] - changes[0], milliseconds(119));
}

TEST_F(FirmwareMessages, SettingsAreKeptOverPowerCuts) {
  talk_->Hello();
  EXPECT_EQ(talk_->Do(SateenLimitLight{.channel = 9, .max_level_permille = 600, .max_on_ms = 2500})
                .result,
            SATEEN_RESULT_DONE);
  EXPECT_EQ(talk_->Do(SateenConfigure{.max_lit = 3, .dim_clock = 2, .sync_edge = 1}).result,
            SATEEN_RESULT_DONE);
  board_->Unplug();
  board_->RunFor(seconds(1));
  board_->Plug();
  board_->RunFor(milliseconds(20));

  const SateenGreeting greeting = talk_->Hello();

  EXPECT_EQ(greeting.max_level_permille[9], 600);
  EXPECT_EQ(greeting.max_on_ms[9], 2500);
  EXPECT_EQ(greeting.max_level_permille[8], 1000);
  EXPECT_EQ(greeting.max_lit, 3);
  EXPECT_EQ(greeting.dim_clock, 2);
  EXPECT_EQ(greeting.sync_edge, 1);
  EXPECT_EQ(greeting.fault, SATEEN_FAULT_NONE);
}

TEST_F(FirmwareMessages, ClearFaultClearsTheFaultThatItNames) {
  talk_->Hello();
  talk_->Light(0, 1000, 10'000);
  board_->RunFor(milliseconds(2100));  // silence
  ASSERT_EQ(talk_->Status().fault, SATEEN_FAULT_HOST_SILENT);

  EXPECT_EQ(talk_->Do(SateenClearFault{.fault = SATEEN_FAULT_WATCHDOG}).fault,
            SATEEN_FAULT_HOST_SILENT);
  EXPECT_EQ(talk_->Do(SateenClearFault{.fault = SATEEN_FAULT_HOST_SILENT}).fault,
            SATEEN_FAULT_NONE);
}

TEST_F(FirmwareMessages, FirmwareForUseDoesNotHangOnCommand) {
  talk_->Hello();
  EXPECT_EQ(talk_->Do(SateenHang{}).result, SATEEN_RESULT_UNKNOWN_MESSAGE);
}

TEST_F(FirmwareMessages, UnknownMessagesAndWrongSizesChangeNothing) {
  talk_->Hello();
  talk_->Light(3, 300, 9000);
  const std::set<int> known = {
      SATEEN_HELLO,       SATEEN_SET_LIGHT,   SATEEN_ALL_OFF,         SATEEN_STATUS,
      SATEEN_ARM,         SATEEN_LIMIT_LIGHT, SATEEN_TRIGGER_SHUTTER, SATEEN_CONFIGURE,
      SATEEN_CLEAR_FAULT, SATEEN_HANG};
  for (int message = 0; message < 256; ++message) {
    const bool is_known = known.contains(message);
    const Frame frame =
        talk_->Exchange(static_cast<uint8_t>(message), std::vector<uint8_t>(is_known ? 20 : 4));
    // The answer is of the kind that the message has, and says in its second byte what is wrong.
    if (message == SATEEN_HELLO) {
      EXPECT_EQ(frame.message, SATEEN_GREETING);
      continue;
    }
    ASSERT_GE(frame.payload.size(), 2U) << message;
    EXPECT_EQ(frame.payload[0], message);
    EXPECT_EQ(frame.payload[1], is_known ? SATEEN_RESULT_WRONG_SIZE : SATEEN_RESULT_UNKNOWN_MESSAGE)
        << message;
  }
  EXPECT_THAT(board_->Lit(), ElementsAre(3));
}

TEST_F(FirmwareMessages, ARepeatedFrameIsAnsweredAndNotDoneAgain) {
  talk_->Hello();
  const std::vector<uint8_t> light =
      Wire<SateenSetLight>::Pack({.channel = 2, .level_permille = 800, .on_ms = 1000, .add = 0});
  talk_->Exchange(77, SATEEN_SET_LIGHT, light);
  board_->RunFor(milliseconds(600));

  const auto state = Wire<SateenState>::Unpack(talk_->Exchange(77, SATEEN_SET_LIGHT, light));

  ASSERT_TRUE(state);
  EXPECT_EQ(state->result, SATEEN_RESULT_DONE);
  EXPECT_NEAR(state->left_ms, 400, 3);  // the time that is left was not set anew
  EXPECT_EQ(talk_->Status().repeats, 1);
}

TEST_F(FirmwareMessages, AnotherCommandUnderTheSameNumberIsRefused) {
  talk_->Hello();
  talk_->Exchange(78, SATEEN_SET_LIGHT,
                  Wire<SateenSetLight>::Pack({.channel = 2, .level_permille = 800, .on_ms = 1000}));

  const auto state = Wire<SateenState>::Unpack(talk_->Exchange(
      78, SATEEN_SET_LIGHT,
      Wire<SateenSetLight>::Pack({.channel = 5, .level_permille = 800, .on_ms = 1000})));

  ASSERT_TRUE(state);
  EXPECT_EQ(state->result, SATEEN_RESULT_SEQUENCE_REUSED);
  EXPECT_THAT(board_->Lit(), ElementsAre(2));
}

}  // namespace
}  // namespace sateen::testing::firmware_messages_test
