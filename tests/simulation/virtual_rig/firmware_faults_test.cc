#include <gmock/gmock.h>

#include <random>

#include "firmware/controller/pins.h"
#include "tests/simulation/virtual_rig/board_talk.h"

// Faults of the board: resets, hangs, a damaged EEPROM, noise on its line. After each of them all
// lights are off, the board says what it was, and goes on working.
namespace sateen::testing::firmware_faults_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class FirmwareFaults : public BoardTest {
 protected:
  FirmwareFaults() { talk_->Hello(); }

  // All off, and the watchdog's reset is over.
  void Hang(bool interrupts) {
    talk_->Light(4, 500, 5000);
    talk_->Do(SateenHang{.interrupts = static_cast<uint8_t>(interrupts ? 1 : 0)});
    board_->RunFor(milliseconds(300));
    EXPECT_THAT(board_->Lit(), IsEmpty());
  }

  void ExpectWorking() {
    talk_->Frames();
    EXPECT_THAT(board_->Lit(), IsEmpty());
    talk_->Hello();
    EXPECT_EQ(talk_->Light(1, 50, 100).lit, 1 << 1);
    EXPECT_THAT(board_->Lit(), ElementsAre(1));
    talk_->Do(SateenAllOff{});
  }
};

TEST_F(FirmwareFaults, TheWatchdogEndsAHangAndTheHostLearnsOfIt) {
  for (const int interrupts : {0, 1}) {
    Start(TestFirmware());
    talk_->Hello();
    talk_->Light(7, 1000, 10'000);
    talk_->Do(SateenHang{.interrupts = static_cast<uint8_t>(interrupts)});
    const SimTime hung = board_->Now();
    std::optional<SimTime> off;
    std::optional<SimTime> reset;
    const int watch = board_->Watch({.light = [&](const LightChange& change) { off = change.time; },
                                     .reset = [&](SimTime time, ResetCause) { reset = time; }});

    board_->RunFor(milliseconds(300));
    board_->Unwatch(watch);

    ASSERT_TRUE(off && reset);
    fmt::print("hang with interrupts {}: off and reset after {:.3f} s\n", interrupts,
               std::chrono::duration<double>(*reset - hung).count());
    EXPECT_LT(*reset - hung, milliseconds(300));
    EXPECT_THAT(board_->Lit(), IsEmpty());
    const auto greeting = talk_->TakeUnasked<SateenGreeting>();
    ASSERT_TRUE(greeting);
    EXPECT_EQ(greeting->reset_cause, SATEEN_RESET_WATCHDOG);
    EXPECT_EQ(greeting->fault, SATEEN_FAULT_WATCHDOG);
    ExpectWorking();
    EXPECT_EQ(talk_->Status().fault, SATEEN_FAULT_WATCHDOG);  // until somebody clears it
  }
}

// Boot loaders clear what tells the firmware why it starts. Optiboot leaves it in r2, where a
// watchdog may be its own; then a main loop that was stuck decides.
TEST_F(FirmwareFaults, BehindOptibootTheCauseIsReadFromItsRegister) {
  Start(TestFirmware());
  board_->InnerChip().PutBehind(BootLoader::kTellsInR2);
  talk_->Hello();
  Hang(/*interrupts=*/true);
  EXPECT_EQ(talk_->Hello().reset_cause, SATEEN_RESET_WATCHDOG);
  board_->ResetByHost(seconds(1));
  board_->RunFor(milliseconds(1020));
  EXPECT_EQ(talk_->Hello().reset_cause, SATEEN_RESET_EXTERNAL);
  board_->BrownOut(milliseconds(30));
  board_->RunFor(milliseconds(50));
  EXPECT_EQ(talk_->Hello().reset_cause, SATEEN_RESET_BROWN_OUT);
  // The limit of it: with interrupts off nobody counted how long the loop was stuck. The light goes
  // off all the same, and the board says that it does not know.
  Hang(/*interrupts=*/false);
  EXPECT_EQ(talk_->Hello().reset_cause, 0);
}

// Behind one that leaves nothing the firmware knows a loop that was stuck, and else says that it
// does not know; it says nothing false, and all is off.
TEST_F(FirmwareFaults, BehindABootLoaderThatTellsNothingNoCauseIsInvented) {
  Start(TestFirmware());
  board_->InnerChip().PutBehind(BootLoader::kTellsNothing);
  talk_->Hello();
  Hang(/*interrupts=*/true);
  EXPECT_EQ(talk_->Hello().reset_cause, SATEEN_RESET_WATCHDOG);
  board_->ResetByHost(seconds(1));
  board_->RunFor(milliseconds(1020));
  EXPECT_EQ(talk_->Hello().reset_cause, 0);
  board_->Unplug();
  board_->Plug();
  board_->RunFor(milliseconds(20));
  EXPECT_EQ(talk_->Hello().reset_cause, SATEEN_RESET_POWER_ON);
}

TEST_F(FirmwareFaults, AWatchdogResetIsTakenForNothingElse) {
  Start(TestFirmware());
  talk_->Hello();
  talk_->Do(SateenHang{});
  board_->RunFor(milliseconds(300));
  board_->Reset();
  board_->RunFor(milliseconds(20));
  EXPECT_EQ(talk_->Hello().reset_cause, SATEEN_RESET_EXTERNAL);
}

// The chip adds each cause to those that nobody has cleared.
TEST_F(FirmwareFaults, OfSeveralResetsTheLatestCauseIsTold) {
  for (const ResetCause cause : {ResetCause::kExternal, ResetCause::kBrownOut,
                                 ResetCause::kWatchdog, ResetCause::kExternal}) {
    board_->Reset(cause);
    board_->RunFor(milliseconds(20));
    EXPECT_EQ(talk_->Hello().reset_cause, static_cast<int>(cause));
    EXPECT_EQ(talk_->Status().reset_cause, static_cast<int>(cause));
  }
}

TEST_F(FirmwareFaults, OutputsAreOffFromTheFirstCycleOfEachReset) {
  for (const ResetCause cause :
       {ResetCause::kPowerOn, ResetCause::kExternal, ResetCause::kBrownOut}) {
    talk_->Hello();
    talk_->Light(12, 1000, 5000);
    talk_->Do(SateenTriggerShutter{.press_ms = 5000});
    ASSERT_THAT(board_->Lit(), ElementsAre(12));

    board_->Reset(cause);

    EXPECT_THAT(board_->Lit(), IsEmpty());
    EXPECT_FALSE(board_->ShutterClosed());
    board_->ClearRecords();
    board_->RunFor(milliseconds(50));
    for (const ChannelRecord& record : board_->Records()) {
      EXPECT_EQ(record.times_on, 0) << Name(cause);
    }
    EXPECT_EQ(talk_->Hello().reset_cause, static_cast<int>(cause));
  }
}

TEST_F(FirmwareFaults, ABrownOutTurnsOffAndIsAFault) {
  talk_->Light(2, 1000, 5000);
  board_->BrownOut(milliseconds(5));
  EXPECT_THAT(board_->Lit(), IsEmpty());
  board_->RunFor(milliseconds(50));

  const auto greeting = talk_->TakeUnasked<SateenGreeting>();
  ASSERT_TRUE(greeting);
  EXPECT_EQ(greeting->reset_cause, SATEEN_RESET_BROWN_OUT);
  EXPECT_EQ(greeting->fault, SATEEN_FAULT_BROWN_OUT);
  ExpectWorking();
}

TEST_F(FirmwareFaults, AResetInTheMiddleOfAFrameLeavesNothingOfIt) {
  const std::vector<uint8_t> frame =
      Encode(9, SATEEN_SET_LIGHT,
             Wire<SateenSetLight>::Pack({.channel = 6, .level_permille = 900, .on_ms = 900}));
  for (size_t cut = 1; cut < frame.size(); ++cut) {
    talk_->Hello();
    board_->ClearRecords();
    board_->Send(std::span(frame).first(cut));
    board_->RunUntil([&] { return board_->InnerChip().BytesUnderWay() == 0; }, milliseconds(5));
    board_->Reset();
    board_->RunFor(milliseconds(20));
    talk_->Frames();
    // The rest of the old frame, and a whole one: neither may do anything before a hello.
    board_->Send(std::span(frame).subspan(cut));
    board_->Send(frame);
    board_->RunFor(milliseconds(5));

    EXPECT_EQ(board_->Records()[6].times_on, 0) << "cut after " << cut << " bytes";
    ExpectWorking();
  }
}

TEST_F(FirmwareFaults, DamagedLimitsMakeTheBoardCareful) {
  talk_->Do(SateenLimitLight{.channel = 0, .max_level_permille = 800, .max_on_ms = 5000});
  const std::vector<uint8_t> good = board_->InnerChip().Eeprom();
  std::vector<size_t> used;
  for (size_t i = 0; i < good.size(); ++i) {
    if (good[i] != 0xFF) {
      used.push_back(i);
    }
  }
  ASSERT_GE(used.size(), 40U);
  for (auto& may : may_) {
    may = {.on = milliseconds(1000), .level = 0.1};
  }
  for (size_t n = 0; n < used.size(); ++n) {
    const auto flipped = static_cast<uint8_t>(good[used[n]] ^ 1U << n % 8);
    board_->InnerChip().WriteEeprom(used[n], flipped);
    board_->Reset();
    board_->ClearRecords();
    board_->RunFor(milliseconds(20));

    const SateenGreeting greeting = talk_->Hello();

    EXPECT_EQ(greeting.fault, SATEEN_FAULT_LIMITS_LOST) << "byte " << used[n];
    EXPECT_EQ(greeting.max_level_permille[0], 100);
    EXPECT_EQ(greeting.max_on_ms[13], 1000);
    EXPECT_EQ(talk_->Light(3, 101, 100).result, SATEEN_RESULT_OVER_LIMIT);
    EXPECT_EQ(talk_->Light(3, 100, 1001).result, SATEEN_RESULT_OVER_LIMIT);
    EXPECT_EQ(talk_->Light(3, 100, 100).result, SATEEN_RESULT_DONE);
    board_->InnerChip().WriteEeprom(used[n], good[used[n]]);
  }
  board_->Reset();
  board_->RunFor(milliseconds(20));
  EXPECT_EQ(talk_->Hello().max_level_permille[0], 800);
}

TEST_F(FirmwareFaults, PowerThatFailsWhileLimitsAreStoredIsNoticed) {
  for (int cut_ms = 5; cut_ms < 260; cut_ms += 31) {
    talk_->Hello();
    // Other values each time, so that bytes are written.
    board_->Send(Encode(
        static_cast<uint8_t>(cut_ms), SATEEN_LIMIT_LIGHT,
        Wire<SateenLimitLight>::Pack({.channel = static_cast<uint8_t>(cut_ms % 14),
                                      .max_level_permille = static_cast<uint16_t>(100 + cut_ms),
                                      .max_on_ms = static_cast<uint16_t>(1000 + cut_ms)})));
    board_->RunFor(milliseconds(cut_ms) / 8);
    board_->Unplug();
    board_->RunFor(milliseconds(100));
    board_->Plug();
    board_->RunFor(milliseconds(20));
    const SateenGreeting greeting = talk_->Hello();
    // As it was before, as it was meant to be, or careful.
    const int channel = cut_ms % 14;
    const int level = greeting.max_level_permille[channel];
    const int on_ms = greeting.max_on_ms[channel];
    const bool old_or_new =
        (level == 1000 && on_ms == 10'000) || (level == 100 + cut_ms && on_ms == 1000 + cut_ms);
    EXPECT_TRUE(greeting.fault == SATEEN_FAULT_LIMITS_LOST ? level == 100 && on_ms == 1000
                                                           : old_or_new)
        << cut_ms << " " << level << " " << on_ms << " fault " << int{greeting.fault};
    for (size_t i = 0; i < 128; ++i) {
      board_->InnerChip().WriteEeprom(i, 0xFF);
    }
    board_->Reset();
    board_->RunFor(milliseconds(20));
  }
}

TEST_F(FirmwareFaults, AFlippedBitIsAnsweredCountedAndChangesNothing) {
  talk_->Light(3, 300, 9000);
  const std::vector<uint8_t> frame =
      Encode(250, SATEEN_SET_LIGHT,
             Wire<SateenSetLight>::Pack({.channel = 6, .level_permille = 900, .on_ms = 900}));
  int answered = 0;
  for (size_t byte = 1; byte + 1 < frame.size(); ++byte) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      std::vector<uint8_t> bad = frame;
      bad[byte] = static_cast<uint8_t>(bad[byte] ^ 1U << bit);
      for (const Frame& answer : talk_->SendAndListen(bad, milliseconds(2))) {
        answered += answer.message == SATEEN_BAD_FRAME ? 1 : 0;
      }
      ASSERT_THAT(board_->Lit(), ElementsAre(3)) << "byte " << byte << " bit " << bit;
      ASSERT_DOUBLE_EQ(board_->Level(3), 0.3);
    }
  }
  const SateenReport report = talk_->Status();
  EXPECT_GE(answered, static_cast<int>(8 * (frame.size() - 2)));
  EXPECT_EQ(report.bad_frames, answered);
  EXPECT_EQ(report.lit, 1 << 3);
}

// The full length, a million bytes, is in board_stress.
TEST_F(FirmwareFaults, RandomBytesLightNothing) {
  std::mt19937_64 random(1);
  board_->ClearRecords();
  constexpr int kBytes = 40'000;
  std::vector<uint8_t> bytes(400);
  for (int sent = 0; sent < kBytes; sent += static_cast<int>(bytes.size())) {
    for (uint8_t& byte : bytes) {
      byte = static_cast<uint8_t>(random());
    }
    board_->Send(bytes);
    board_->RunUntil([&] { return board_->InnerChip().BytesUnderWay() == 0; }, seconds(1));
    talk_->Frames();
  }
  for (const ChannelRecord& record : board_->Records()) {
    EXPECT_EQ(record.times_on, 0);
  }
  EXPECT_FALSE(board_->ShutterClosed());
  board_->Send(std::vector<uint8_t>{0});
  board_->RunFor(milliseconds(5));
  const SateenReport report = talk_->Status();
  EXPECT_GT(report.bad_frames, 100);
  EXPECT_EQ(report.reset_cause, SATEEN_RESET_POWER_ON);  // it did not hang on any of them
  ExpectWorking();
}

}  // namespace
}  // namespace sateen::testing::firmware_faults_test
