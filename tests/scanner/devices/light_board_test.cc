#include "scanner/devices/light_board.h"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/scanner/devices/fake_board.h"

namespace sateen::light_board_test {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using testing::FakeBoard;
using testing::FakePort;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::Noise;
using State = LightBoard::State;

constexpr milliseconds kSecond{1000};

LightBoard BoardOn(FakeBoard& fake, const LightBoardOptions& options = {}) {
  return LightBoard(std::make_unique<FakePort>(fake), options);
}

LightBoard Connected(FakeBoard& fake, const LightBoardOptions& options = {}) {
  LightBoard board = BoardOn(fake, options);
  const Status connected = board.Connect();
  EXPECT_TRUE(connected) << connected.error().message;
  return board;
}

template <typename T>
ErrorCode CodeOf(const Result<T>& result) {
  return result ? ErrorCode::kInvalidArgument : result.error().code;
}

TEST(LightBoard, ConnectsByGreeting) {
  FakeBoard fake;
  fake.lit = {4};
  LightBoard board = BoardOn(fake);
  EXPECT_EQ(board.state(), State::kClosed);
  ASSERT_TRUE(board.Connect());
  EXPECT_EQ(board.state(), State::kReady);
  EXPECT_THAT(fake.lit, IsEmpty());  // hello turns everything off
  EXPECT_EQ(board.Info().lights.size(), 14u);
  EXPECT_DOUBLE_EQ(board.Info().lights[13].max_level, 0.9);
  EXPECT_EQ(board.Info().lights[13].max_on, 10 * kSecond);
  EXPECT_EQ(board.Info().build_id, "fakefake");
  EXPECT_EQ(board.Info().silence, 2 * kSecond);
  EXPECT_THAT(board.Info().reset_cause, HasSubstr("power"));
}

TEST(LightBoard, AnswersCarryTheStateAfterTheCommand) {
  FakeBoard fake;
  LightBoard board = Connected(fake);
  const Result<BoardState> on = board.SetLight(3, 0.5696, kSecond);  // to the next thousandth
  ASSERT_TRUE(on) << on.error().message;
  EXPECT_EQ(on->lit, 1u << 3);
  EXPECT_DOUBLE_EQ(on->level, 0.57);
  EXPECT_EQ(on->armed, -1);
  EXPECT_EQ(fake.lights_set[0].level_permille, 570);
  EXPECT_EQ(fake.lights_set[0].on_ms, 1000);
  const Result<BoardReport> report = board.Report();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->state.lit, 1u << 3);
  EXPECT_EQ(report->frames, 3u);  // hello, set light, status
  ASSERT_TRUE(board.AllOff());
  EXPECT_THAT(fake.lit, IsEmpty());
}

TEST(LightBoard, SendsNothingThatTheBoardWouldRefuse) {
  FakeBoard fake;
  LightBoard board = Connected(fake);
  const int frames = fake.frames_received;
  EXPECT_THAT(board.SetLight(14, 0.5, kSecond).error().message, HasSubstr("lights 0 to 13"));
  EXPECT_EQ(board.SetLight(-1, 0.5, kSecond).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(board.SetLight(3, 1.1, kSecond).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(board.SetLight(3, std::nan(""), kSecond).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(board.SetLight(3, 0.0001, kSecond).error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(board.SetLight(3, 0.95, kSecond).error().message, HasSubstr("limit of 90.0 %"));
  EXPECT_THAT(board.SetLight(3, 0.5, 11 * kSecond).error().message, HasSubstr("10000 ms"));
  EXPECT_EQ(board.SetLight(3, 0.5, milliseconds(0)).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(board.Arm(3, 0.0, kSecond).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(board.TriggerShutter(milliseconds(10001)).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(board.Limit(3, {.max_level = 1.0, .max_on = milliseconds(60001)}).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(board.Configure({.max_lit = 0}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(fake.frames_received, frames);
  EXPECT_EQ(board.state(), State::kReady);
}

TEST(LightBoard, ARefusalIsAnErrorAndChangesNothing) {
  FakeBoard fake;
  LightBoard board = Connected(fake);
  fake.refuse = SATEEN_RESULT_TOO_MANY_LIT;
  const Result<BoardState> refused = board.SetLight(3, 0.5, kSecond);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kDevice);
  EXPECT_THAT(refused.error().message, HasSubstr("as many lights are on"));
  EXPECT_EQ(board.state(), State::kReady);
}

TEST(LightBoard, ALostAnswerIsAskedForAgainAndTheCommandDoneOnce) {
  FakeBoard fake;
  LightBoard board = Connected(fake);
  fake.mute = 3;
  ASSERT_TRUE(board.SetLight(5, 0.5, kSecond));
  EXPECT_EQ(fake.executed[SATEEN_SET_LIGHT], 1);
  EXPECT_EQ(fake.frames_received, 1 + 4);
}

TEST(LightBoard, NoAnswerAfterAllTriesLosesTheConnection) {
  FakeBoard fake;
  LightBoard board = Connected(fake, {.tries = 3});
  fake.mute = 1000;
  const int frames = fake.frames_received;
  EXPECT_EQ(CodeOf(board.SetLight(5, 0.5, kSecond)), ErrorCode::kTimeout);
  EXPECT_EQ(fake.frames_received - frames, 3);
  EXPECT_EQ(board.state(), State::kLost);
  EXPECT_EQ(CodeOf(board.SetLight(6, 0.5, kSecond)), ErrorCode::kDevice);  // sends nothing
  EXPECT_EQ(fake.frames_received - frames, 3);
  fake.mute = 0;
  ASSERT_TRUE(board.Connect());
  EXPECT_EQ(board.state(), State::kReady);
  EXPECT_THAT(fake.lit, IsEmpty());  // lights of the command that failed are off
}

TEST(LightBoard, AnAnswerThatComesLateIsNotTakenForTheNext) {
  FakeBoard fake;
  LightBoard board = Connected(fake);
  fake.latency = milliseconds(61);  // just after the command has been sent again
  const Result<BoardState> first = board.SetLight(5, 0.5, kSecond);
  ASSERT_TRUE(first) << first.error().message;
  fake.latency = milliseconds(1);
  const Result<BoardState> second =
      board.SetLight(6, 0.7, kSecond);  // the repeat's answer is under way
  ASSERT_TRUE(second);
  EXPECT_EQ(second->lit, 1u << 6);
  EXPECT_EQ(fake.executed[SATEEN_SET_LIGHT], 2);
}

TEST(LightBoard, FindsItsFeetAfterGarbage) {
  FakeBoard fake;
  LightBoard board = Connected(fake);
  std::vector<std::uint8_t> garbage(3000);
  for (int round = 0; round < 20; ++round) {
    for (std::uint8_t& byte : garbage) {
      byte = static_cast<std::uint8_t>(fake.random());
    }
    fake.SendGarbage(garbage);
    const Result<BoardState> state = board.SetLight(round % 14, 0.5, kSecond);
    ASSERT_TRUE(state) << state.error().message;
    EXPECT_EQ(state->lit, 1u << (round % 14));
  }
  EXPECT_EQ(fake.executed[SATEEN_SET_LIGHT], 20);
}

TEST(LightBoard, ARestartOfTheBoardIsNoticedInstantly) {
  FakeBoard fake;
  LightBoard board = Connected(fake);
  ASSERT_TRUE(board.SetLight(5, 0.5, kSecond));
  fake.Restart();
  const Result<BoardState> after = board.SetLight(6, 0.5, kSecond);
  ASSERT_FALSE(after);
  EXPECT_THAT(after.error().message, HasSubstr("restarted"));
  EXPECT_EQ(board.state(), State::kRestarted);
  EXPECT_THAT(fake.lit, IsEmpty());
  EXPECT_EQ(CodeOf(board.SetLight(6, 0.5, kSecond)), ErrorCode::kDevice);
  const int opened = fake.opened;
  ASSERT_TRUE(board.Connect());
  EXPECT_EQ(fake.opened, opened);  // the port had not gone
  EXPECT_TRUE(board.SetLight(6, 0.5, kSecond));
}

TEST(LightBoard, ARestartWhoseGreetingIsLostIsNoticedByTheRefusal) {
  FakeBoard fake;
  LightBoard board = Connected(fake);
  fake.mute = 1;
  fake.Restart();
  EXPECT_FALSE(board.SetLight(6, 0.5, kSecond));
  EXPECT_EQ(board.state(), State::kRestarted);
  EXPECT_THAT(fake.lights_set, IsEmpty());
}

TEST(LightBoard, WaitsForABootloader) {
  FakeBoard fake;
  fake.boot = milliseconds(1500);
  LightBoard board = BoardOn(fake);
  const Status connected = board.Connect();
  ASSERT_TRUE(connected) << connected.error().message;
  EXPECT_TRUE(board.SetLight(1, 0.5, kSecond));  // the boot's own greeting is no restart any more
}

TEST(LightBoard, NoGreetingNamesTheCause) {
  FakeBoard fake;
  fake.mute = 1000;
  LightBoard board = BoardOn(fake);
  const Status connected = board.Connect();
  ASSERT_FALSE(connected);
  EXPECT_EQ(connected.error().code, ErrorCode::kTimeout);
  EXPECT_THAT(connected.error().message, HasSubstr("make flash"));
  EXPECT_EQ(board.state(), State::kClosed);
  EXPECT_LE(fake.now, milliseconds(3001));
}

TEST(LightBoard, AnotherProtocolIsRefused) {
  FakeBoard fake;
  fake.protocol_major = 9;
  LightBoard board = BoardOn(fake);
  const Status connected = board.Connect();
  ASSERT_FALSE(connected);
  EXPECT_THAT(connected.error().message, HasSubstr("protocol 9.0"));
  EXPECT_EQ(board.state(), State::kClosed);
}

// A board that is unplugged in state `state` is found again within a second of being plugged in.
class Unplugged : public ::testing::TestWithParam<State> {};

TEST_P(Unplugged, IsFoundAgain) {
  FakeBoard fake;
  FakePort* port = new FakePort(fake);
  LightBoard board{std::unique_ptr<BytePort>(port)};
  if (GetParam() != State::kClosed) {
    ASSERT_TRUE(board.Connect());
    ASSERT_TRUE(board.SetLight(2, 0.5, kSecond));
  }
  if (GetParam() == State::kRestarted) {
    fake.Restart();
    ASSERT_FALSE(board.Report());
  }
  fake.Unplug();
  if (GetParam() == State::kLost) {
    EXPECT_EQ(CodeOf(board.Report()), ErrorCode::kDevice);
  }
  ASSERT_EQ(board.state(), GetParam());
  const FakeBoard::Time replug = fake.now + milliseconds(700);
  port->on_wait = [&] {
    if (!fake.plugged && fake.now >= replug) {
      fake.Replug();
    }
  };
  if (GetParam() == State::kReady) {
    const Result<BoardState> state = board.SetLight(3, 0.5, kSecond);
    ASSERT_FALSE(state);
    EXPECT_EQ(board.state(), State::kLost);
  }
  if (GetParam() == State::kClosed) {
    EXPECT_EQ(CodeOf(board.Connect()), ErrorCode::kDevice);  // at once
    EXPECT_LT(fake.now, replug);
    port->Wait(replug - fake.now);
  }
  const Status connected = board.Connect();
  ASSERT_TRUE(connected) << connected.error().message;
  EXPECT_LE(fake.now - replug, kSecond);
  const Result<BoardReport> report = board.Report();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->state.lit, 0u);
}

INSTANTIATE_TEST_SUITE_P(EveryState, Unplugged,
                         ::testing::Values(State::kClosed, State::kReady, State::kLost,
                                           State::kRestarted));

TEST(LightBoard, ClosingAndDestroyingTurnEverythingOff) {
  FakeBoard fake;
  {
    LightBoard board = Connected(fake);
    ASSERT_TRUE(board.SetLight(2, 0.5, kSecond));
    LightBoard moved = std::move(board);
    EXPECT_EQ(board.state(),
              State::kClosed);  // NOLINT(bugprone-use-after-move): a state of its own
    EXPECT_EQ(moved.state(), State::kReady);
    EXPECT_THAT(fake.lit, ElementsAre(2));
  }
  EXPECT_THAT(fake.lit, IsEmpty());
  LightBoard board = Connected(fake);
  ASSERT_TRUE(board.SetLight(3, 0.5, kSecond));
  board.Close();
  EXPECT_THAT(fake.lit, IsEmpty());
  EXPECT_EQ(board.state(), State::kClosed);
  EXPECT_EQ(CodeOf(board.Report()), ErrorCode::kDevice);
  EXPECT_TRUE(board.Connect());
}

TEST(LightBoard, OptionsAreChecked) {
  FakeBoard fake;
  for (const LightBoardOptions& options :
       {LightBoardOptions{.answer_timeout = milliseconds(0)}, LightBoardOptions{.tries = 0},
        LightBoardOptions{.greeting_timeout = milliseconds(0)}}) {
    LightBoard board = BoardOn(fake, options);
    ASSERT_FALSE(board.Connect());
    EXPECT_EQ(board.Connect().error().code, ErrorCode::kInvalidArgument);
  }
}

// Bytes dropped, flipped and inserted at 1e-3 each in both directions: no light is on that was not
// asked for, each command is done exactly once or reported failed.
TEST(LightBoard, ANoisyLineNeverLightsTheWrongLight) {
  FakeBoard fake;
  const Noise noise = {.drop = 1e-3, .flip = 1e-3, .insert = 1e-3};
  fake.to_board = noise;
  fake.to_host = noise;
  LightBoard board = Connected(fake);
  int done = 0;
  for (int i = 0; i < 20000; ++i) {
    const int channel = static_cast<int>(fake.random() % 14);
    const double level = static_cast<double>(1 + fake.random() % 900) / 1000.0;
    const std::size_t before = fake.lights_set.size();
    const Result<BoardState> state = board.SetLight(channel, level, kSecond);
    const std::size_t executions = fake.lights_set.size() - before;
    ASSERT_LE(executions, 1u);
    if (executions == 1) {
      ASSERT_EQ(fake.lights_set.back().channel, channel);
      ASSERT_EQ(fake.lights_set.back().level_permille, std::lround(level * 1000));
    }
    if (state) {
      ++done;
      ASSERT_EQ(executions, 1u);
      ASSERT_EQ(state->lit, 1u << channel);
    } else {
      ASSERT_TRUE(board.Connect());
    }
  }
  fmt::print("{} of 20000 commands done, {} frames received for them\n", done,
             fake.frames_received);
  EXPECT_GE(done, 19990);  // eight tries fail together once in 10^8
}

}  // namespace
}  // namespace sateen::light_board_test
