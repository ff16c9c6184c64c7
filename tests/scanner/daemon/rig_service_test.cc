#include "scanner/daemon/rig_service.h"

#include <gmock/gmock.h>

#include <stdexcept>

#include "core/notice.h"
#include "tests/scanner/daemon/daemon_fakes.h"

namespace sateen::rig_service_test {
namespace {

using testing::AllEvents;
using testing::FakeDaemon;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kLong;
using ::testing::SizeIs;
using testing::WorkJob;

TEST(RigService, ASecondAskerIsToldWhoHasTheRigAndSinceWhen) {
  FakeDaemon daemon;
  const std::uint64_t id = daemon.TurnOn(3, "alice at the desk");

  const auto refused = daemon.service.Begin(LightJob({.channel = 4}, "bob"));

  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().error.code, ErrorCode::kDevice);
  EXPECT_THAT(refused.error().error.message, HasSubstr("light of 3 by alice at the desk since 20"));
  ASSERT_TRUE(refused.error().holder.has_value());
  EXPECT_EQ(refused.error().holder->id, id);
  daemon.service.Cancel(id, "bob");
  ASSERT_TRUE(daemon.service.WaitIdle(kLong));
  EXPECT_THAT(daemon.rig.board.lights_set, SizeIs(1));
}

TEST(RigService, CancellingTurnsTheLightOffAndNamesWho) {
  FakeDaemon daemon;
  const std::uint64_t id = daemon.TurnOn(3);
  EXPECT_THAT(daemon.service.State().lit, ::testing::ElementsAre(3));

  EXPECT_TRUE(daemon.service.Cancel(id, "bob"));

  const std::vector<JobEvent> events = AllEvents(daemon.service, id);
  ASSERT_TRUE(daemon.service.WaitIdle(kLong));
  EXPECT_THAT(daemon.rig.board.lit, IsEmpty());
  EXPECT_EQ(events.back().type, "failed");
  EXPECT_THAT(events.back().data, HasSubstr("cancelled by bob"));
  EXPECT_EQ(ErrorFromJson(events.back().data).code, ErrorCode::kCancelled);
  EXPECT_THAT(daemon.service.State().lit, IsEmpty());
}

// However a job ends, and whatever it leaves behind.
TEST(RigService, NoLightIsOnAfterAnyEndOfAJob) {
  FakeDaemon daemon;
  const auto leave_on = [](JobContext& job) {
    EXPECT_TRUE((*job.Devices().Board())->SetLight(5, 0.5, std::chrono::seconds(10)));
  };
  const std::vector<JobWork> ends = {[&](JobContext& job) -> Result<std::string> {
                                       leave_on(job);
                                       return "{}";
                                     },
                                     [&](JobContext& job) -> Result<std::string> {
                                       leave_on(job);
                                       return Fail(ErrorCode::kIo, "disk full");
                                     },
                                     [&](JobContext& job) -> Result<std::string> {
                                       leave_on(job);
                                       throw std::runtime_error("out of memory");
                                     }};
  for (const JobWork& work : ends) {
    const auto ended = daemon.service.RunToEnd(WorkJob(work));
    ASSERT_TRUE(ended.has_value());
    EXPECT_THAT(daemon.rig.board.lit, IsEmpty());
    EXPECT_EQ(daemon.service.State().lights_fault, "");
  }
  EXPECT_THAT(daemon.rig.board.lights_set, SizeIs(3));
  EXPECT_THAT(daemon.service.State().last_job->error->message, HasSubstr("out of memory"));
}

TEST(RigService, AJobThatLosesTheBoardIsReportedUntilTheBoardHasConfirmed) {
  FakeDaemon daemon;
  daemon.rig.held = false;  // the link waits for a lost board
  const auto ended = daemon.service.RunToEnd(WorkJob([&](JobContext& job) -> Result<std::string> {
    job.Lit({2});
    EXPECT_TRUE((*job.Devices().Board())->SetLight(2, 0.5, std::chrono::seconds(10)));
    daemon.rig.board.Unplug();
    return Fail(ErrorCode::kDevice, "the port is gone");
  }));
  ASSERT_TRUE(ended.has_value());
  EXPECT_THAT(daemon.service.State().lights_fault, HasSubstr("did not confirm"));
  EXPECT_FALSE(daemon.service.State().board.has_value());

  daemon.rig.board.Replug();
  daemon.rig.board.plugged = true;  // Replug() clears only what was under way
  ASSERT_TRUE(daemon.service.RunToEnd(LightsOffJob("alice")).has_value());
  EXPECT_EQ(daemon.service.State().lights_fault, "");
  EXPECT_EQ(daemon.service.State().board->firmware, "fakefake");
}

// With the wait itself: the board may be back before anybody asks for the state.
TEST(RigService, AWaitThatALostBoardEndsSaysWhy) {
  FakeDaemon daemon;
  const std::uint64_t job =
      *daemon.service.Begin(WorkJob([&](JobContext& context) -> Result<std::string> {
        EXPECT_TRUE((*context.Devices().Board())->SetLight(2, 0.5, std::chrono::seconds(10)));
        daemon.rig.board.Unplug();  // the port's clock stands still: it is waited for without end
        return "{}";
      }));
  const JobWait lost = daemon.service.AwaitEnd(job, kLong);
  EXPECT_EQ(lost.end, WaitEnd::kBoardLost);
  EXPECT_THAT(lost.lights_fault, HasSubstr("did not confirm"));
  daemon.rig.held = false;
  ASSERT_TRUE(daemon.service.WaitIdle(kLong));
  const JobWait ended = daemon.service.AwaitEnd(job, kLong);
  EXPECT_EQ(ended.end, WaitEnd::kEnded);
  EXPECT_EQ(ended.lights_fault, "");
}

// A preview tells of nothing before it ends, and yet has lit a light.
TEST(RigService, AFirstJobThatReportsNothingAndLosesTheBoardIsAFault) {
  FakeDaemon daemon;
  daemon.rig.held = false;  // the link waits for a lost board
  ASSERT_TRUE(daemon.service.RunToEnd(WorkJob([&](JobContext& job) -> Result<std::string> {
    EXPECT_TRUE((*job.Devices().Board())->SetLight(2, 0.5, std::chrono::seconds(10)));
    daemon.rig.board.Unplug();
    return Fail(ErrorCode::kDevice, "lost");
  })));
  EXPECT_THAT(daemon.service.State().lights_fault, HasSubstr("did not confirm"));
}

TEST(RigService, WithoutABoardNothingIsWrongWithTheLights) {
  FakeDaemon daemon;
  daemon.rig.board.plugged = false;
  const auto ended = daemon.service.RunToEnd(
      WorkJob([](JobContext& /*job*/) -> Result<std::string> { return "{}"; }));
  ASSERT_TRUE(ended.has_value());
  EXPECT_EQ(daemon.service.State().lights_fault, "");
}

// Two jobs at once: each has its own, and the daemon's log has all.
TEST(RigService, WhatAJobNoticesIsAmongItsEvents) {
  std::vector<std::string> log;
  const NoticesTo here([&](const std::string& text) { log.push_back(text); });
  FakeDaemon daemon;
  std::atomic<bool> desk_noticed = false;
  std::atomic<bool> rig_noticed = false;
  const auto await = [](const std::atomic<bool>& flag) {
    while (!flag) {
      std::this_thread::yield();
    }
  };
  const auto rig = daemon.service.Begin(WorkJob([&](JobContext& job) -> Result<std::string> {
    await(desk_noticed);
    job.Report("1");
    Notice("'a \"file\"' is not ours");
    rig_noticed = true;
    return "2";
  }));
  JobRequest beside = WorkJob([&](JobContext& /*job*/) -> Result<std::string> {
    Notice("files are back");
    desk_noticed = true;
    await(rig_noticed);
    return "3";
  });
  beside.needs_rig = false;
  const auto desk = daemon.service.Begin(std::move(beside));
  const std::vector<JobEvent> of_rig = AllEvents(daemon.service, *rig);
  const std::vector<JobEvent> of_desk = AllEvents(daemon.service, *desk);
  ASSERT_THAT(of_rig, SizeIs(3));
  EXPECT_EQ(of_rig[1].type, "note");
  EXPECT_EQ(*NoteFromJson(of_rig[1].data), "'a \"file\"' is not ours");
  ASSERT_THAT(of_desk, SizeIs(2));
  EXPECT_EQ(of_desk[0].type, "note");
  EXPECT_EQ(*NoteFromJson(of_desk[0].data), "files are back");
  EXPECT_THAT(log, ::testing::ElementsAre("files are back", "'a \"file\"' is not ours"));
}

TEST(RigService, EventsAreFollowedFromAnyPlace) {
  FakeDaemon daemon;
  const auto id = daemon.service.Begin(WorkJob([](JobContext& job) -> Result<std::string> {
    job.Report("1");
    job.Report("2");
    return "3";
  }));
  const std::vector<JobEvent> all = AllEvents(daemon.service, *id);
  ASSERT_THAT(all, SizeIs(3));
  EXPECT_EQ(all[2].type, "done");
  const auto rest = daemon.service.Follow(*id, 2, kLong);
  ASSERT_THAT(rest->events, SizeIs(1));
  EXPECT_EQ(rest->events[0].sequence, 3U);
  EXPECT_EQ(rest->events[0].data, "3");
  EXPECT_TRUE(rest->ended);
  EXPECT_TRUE(daemon.service.Follow(*id, 3, kLong)->ended);  // does not wait for more
  EXPECT_FALSE(daemon.service.Follow(99, 0, kLong).has_value());
}

TEST(RigService, KeepsNoMoreThanItSays) {
  FakeDaemon daemon;
  const auto talk = [](JobContext& job) -> Result<std::string> {
    for (int i = 0; i < 1500; ++i) {
      job.Report("{}");
    }
    return "{}";
  };
  const auto first = daemon.service.RunToEnd(WorkJob(talk));
  EXPECT_EQ(first->last_event, 1501U);
  const std::vector<JobEvent> kept = AllEvents(daemon.service, first->id);
  EXPECT_THAT(kept, SizeIs(1000));
  EXPECT_EQ(kept.front().sequence, 502U);
  for (int i = 0; i < 30; ++i) {
    ASSERT_TRUE(daemon.service.RunToEnd(LightsOffJob("alice")).has_value());
  }
  EXPECT_FALSE(daemon.service.Find(first->id).has_value());
  EXPECT_THAT(daemon.service.Jobs(), SizeIs(21));
  EXPECT_EQ(daemon.service.Jobs().back().id, 31U);
}

TEST(RigService, StopCancelsTurnsOffAndRefuses) {
  FakeDaemon daemon;
  const std::uint64_t id = daemon.TurnOn(3);
  daemon.service.Stop();
  EXPECT_THAT(daemon.rig.board.lit, IsEmpty());
  EXPECT_EQ(daemon.service.Find(id)->error->code, ErrorCode::kCancelled);
  const auto refused = daemon.service.Begin(LightsOffJob("bob"));
  ASSERT_FALSE(refused.has_value());
  EXPECT_FALSE(refused.error().holder.has_value());
}

// However many others ask for the rig meanwhile.
TEST(RigService, AnUrgentJobThatWasRefusedComesNext) {
  FakeDaemon daemon;
  const JobRequest idle = WorkJob([](JobContext&) -> Result<std::string> { return "{}"; });
  const std::uint64_t light = daemon.TurnOn(3);
  ASSERT_FALSE(daemon.service.Begin(LightsOffJob("alice")));
  daemon.service.Cancel(light, "alice");
  ASSERT_TRUE(daemon.service.WaitIdle(kLong));

  const auto between = daemon.service.Begin(idle);
  ASSERT_FALSE(between.has_value());
  EXPECT_THAT(between.error().error.message, HasSubstr("being turned off"));
  EXPECT_FALSE(between.error().holder.has_value());
  EXPECT_TRUE(daemon.service.RunToEnd(LightsOffJob("alice")).has_value());
  EXPECT_TRUE(daemon.service.RunToEnd(idle).has_value());
}

// A job without devices, that runs until it is cancelled.
JobRequest DeskJob(const std::string& owner) {
  JobRequest job = WorkJob(
      [](JobContext& context) -> Result<std::string> {
        context.Report(R"({"began":true})");
        while (!context.GetTask().Cancelled()) {
          std::this_thread::yield();
        }
        return tl::unexpected(context.GetTask().CheckCancelled().error());
      },
      owner);
  job.needs_rig = false;
  return job;
}

TEST(RigService, AJobWithoutDevicesLeavesTheRigFree) {
  FakeDaemon daemon;
  const std::uint64_t desk = *daemon.service.Begin(DeskJob("alice"));

  EXPECT_FALSE(daemon.service.State().job.has_value());
  const std::uint64_t light = daemon.TurnOn(3, "bob");
  EXPECT_EQ(daemon.service.State().job->id, light);
  daemon.service.Cancel(light, "bob");
  ASSERT_TRUE(daemon.service.WaitIdle(kLong));
  EXPECT_EQ(daemon.Ask("POST", "/v1/lights/off").status, 200);
  EXPECT_EQ(daemon.service.Find(desk)->state, JobState::kRunning);  // lights off is not for it

  daemon.service.Cancel(desk, "carol");
  EXPECT_THAT(AllEvents(daemon.service, desk).back().data, HasSubstr("cancelled by carol"));
  EXPECT_NE(daemon.service.State().last_job->id, desk);
}

TEST(RigService, OneJobWithoutDevicesRunsAtATime) {
  FakeDaemon daemon;
  const std::uint64_t desk = *daemon.service.Begin(DeskJob("alice"));

  const auto refused = daemon.service.Begin(DeskJob("bob"));

  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().holder->id, desk);
  EXPECT_THAT(refused.error().error.message, HasSubstr("DELETE /v1/jobs/1"));
  daemon.service.Stop();
  EXPECT_THAT(daemon.service.Find(desk)->error->message, HasSubstr("the end of the daemon"));
}

TEST(RigService, ARunningJobIsKeptHoweverManyEndMeanwhile) {
  FakeDaemon daemon;
  const std::uint64_t desk = *daemon.service.Begin(DeskJob("alice"));
  for (int k = 0; k < 30; ++k) {
    ASSERT_TRUE(
        daemon.service.RunToEnd(WorkJob([](JobContext&) -> Result<std::string> { return "{}"; })));
  }
  EXPECT_TRUE(daemon.service.Find(desk).has_value());
  EXPECT_LE(daemon.service.Jobs().size(), 22U);
  EXPECT_FALSE(daemon.service.Find(desk + 1).has_value());
}

}  // namespace
}  // namespace sateen::rig_service_test
