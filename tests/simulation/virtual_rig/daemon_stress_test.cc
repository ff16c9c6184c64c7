#include <gmock/gmock.h>

#include "core/files/own_folder.h"
#include "core/notice.h"
#include "scanner/capture/session_proof.h"
#include "scanner/daemon/http/http_client.h"
#include "scanner/daemon/rig_jobs.h"
#include "tests/simulation/virtual_rig/daemon_day.h"

namespace sateen::testing::daemon_stress_test {
namespace {

using ::testing::IsEmpty;

// bench/daemon_bench.cc does the same for a minute.
TEST(DaemonStress, NoLightWithoutAJobWhateverTheClientsDo) {
  StressedDaemon daemon({.client_time = milliseconds(500), .heartbeat = milliseconds(100)});
  std::vector<StressClient> clients;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    clients.emplace_back(daemon, seed);
  }
  std::vector<std::thread> threads;
  threads.reserve(clients.size());
  for (StressClient& client : clients) {
    threads.emplace_back([&client] {
      for (int call = 0; call < 100; ++call) {
        client.Call(/*captures=*/call % 30 == 0);
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  for (const StressClient& client : clients) {
    EXPECT_THAT(client.counts.wrong, IsEmpty());
  }
  daemon.service.Stop();
  EXPECT_THAT(daemon.board->Lit(), IsEmpty());
  EXPECT_GT(daemon.witness.TimesOn(), 0);
  EXPECT_EQ(daemon.witness.Two(), 0);
  EXPECT_EQ(daemon.witness.WithoutJob(), 0);
}

// bench/daemon_bench.cc does 2,000, and prints the memory too, of which a sanitizer keeps more.
TEST(DaemonDay, UsesNoMoreAfterManySessionsThanAfterAFew) {
  StressedDaemon daemon({});
  DaemonDay day(daemon);
  const auto live = [&](int sessions) {
    for (int k = 0; k < sessions; ++k) {
      EXPECT_THAT(day.LiveOneSession(/*solve=*/k % 5 == 0), IsEmpty());
    }
    return UsageNow(daemon);
  };
  const Usage early = live(10);
  const Usage late = live(20);
  EXPECT_LE(late.descriptors, early.descriptors + 2);  // the last connections may still be there
  EXPECT_LE(late.threads, early.threads + 2);
  EXPECT_EQ(early.scratch_files, 0);
  EXPECT_EQ(late.scratch_files, 0);
  EXPECT_EQ(EntriesOf(daemon.folder.Path()), 3);  // rig, socket and its lock
}

// A scratch folder that a preview leaves would be counted.
TEST(DaemonDay, CountsScratchFoldersThatAreThere) {
  const StressedDaemon daemon({});
  EXPECT_EQ(UsageNow(daemon).scratch_files, 0);
  const Result<OwnFolder> scratch = MakeScratchFolder("preview");
  ASSERT_TRUE(scratch) << scratch.error().message;
  EXPECT_EQ(UsageNow(daemon).scratch_files, 1);
}

TEST(Daemon, ACaptureByTheApiIsWholeAndTellsHowFarItIs) {
  StressedDaemon daemon({});
  const std::filesystem::path dir = daemon.folder.Path() / "twill";
  const std::string begun =
      Exchange(daemon.socket, HttpRequest("POST", "/v1/jobs",
                                          nlohmann::json{{"kind", "capture"},
                                                         {"rig", daemon.rig_file.string()},
                                                         {"output", dir.string()}}
                                              .dump()));
  ASSERT_EQ(StatusOf(begun), 202) << begun;
  const std::string events = Exchange(daemon.socket, HttpRequest("GET", "/v1/jobs/1/events"));
  EXPECT_THAT(events, ::testing::HasSubstr("event: done\ndata: {\"taken\":13,\"kept\":0"));
  EXPECT_THAT(daemon.witness.Lit(), 0U);
  EXPECT_EQ(*VerifySession(dir, {}), 14);
}

// A file of another lies among the frames.
TEST(Daemon, WhatACaptureNoticesReachesWhoAskedForIt) {
  const TempFolder folder;
  const std::filesystem::path dir = folder.Path() / "twill";
  const std::filesystem::path socket = folder.Path() / "s.sock";
  const Rig rig = CaptureRig();
  WriteText(folder.Path() / "rig.json", RigToJson(rig));
  const auto board = *VirtualBoard::Load(Firmware());
  auto camera = std::make_unique<LitCamera>(*board, LightImages(rig));
  camera->on_exposed = [&](int /*capture*/) { WriteText(dir / "frames/notes.txt", "mine"); };
  RigService service(
      std::make_unique<RigDevices>(std::make_unique<SimulatedPort>(*board), std::move(camera)));
  const Api api(service, {.capture = QuickCapture()});
  const HttpServer server(*Listener::OnUnixSocket(socket), api, service, std::nullopt);
  std::vector<std::string> notes;
  const NoticesTo here([&](const std::string& text) { notes.push_back(text); });

  const Result<CaptureSummary> summary = CaptureByDaemon(
      DaemonClient(socket),
      {.rig = folder.Path() / "rig.json", .output = dir, .options = QuickCapture()}, {});

  ASSERT_TRUE(summary) << summary.error().message;
  ASSERT_EQ(notes.size(), 2U);  // as the daemon's log has it, and as the command prints it
  EXPECT_THAT(notes[0], ::testing::HasSubstr("not of this capture and left alone: notes.txt"));
  EXPECT_EQ(notes[1], notes[0]);
}

// Cancelled in the middle of a capture: off, and the session can be continued.
TEST(Daemon, CancellingACaptureTurnsTheLightOffAndKeepsItsFrames) {
  StressedDaemon daemon({});
  const std::filesystem::path dir = daemon.folder.Path() / "twill";
  const auto ask = [&](const std::string& method, const std::string& path,
                       const nlohmann::json& body = nlohmann::json()) {
    return Exchange(daemon.socket, HttpRequest(method, path, body.is_null() ? "" : body.dump()));
  };
  const nlohmann::json fresh = {
      {"kind", "capture"}, {"rig", daemon.rig_file.string()}, {"output", dir.string()}};
  ASSERT_EQ(StatusOf(ask("POST", "/v1/jobs", fresh)), 202);
  while (daemon.witness.TimesOn() < 3) {
    std::this_thread::yield();
  }
  EXPECT_EQ(StatusOf(ask("POST", "/v1/lights/off")), 200);
  EXPECT_EQ(daemon.witness.Lit(), 0U);
  EXPECT_THAT(ask("GET", "/v1/jobs/1"), ::testing::HasSubstr("cancelled by process"));
  ASSERT_EQ(StatusOf(ask("POST", "/v1/jobs",
                         {{"kind", "capture"}, {"output", dir.string()}, {"resume", true}})),
            202);
  EXPECT_THAT(ask("GET", "/v1/jobs/3/events"), ::testing::HasSubstr("event: done"));
  EXPECT_EQ(*VerifySession(dir, {}), 14);
}

// A killed daemon says nothing more to the board, which is all that the board can see of it.
TEST(Daemon, KilledWithALightOnTheBoardTurnsItOff) {
  const auto board = *VirtualBoard::Load(Firmware());
  const auto port = std::make_unique<SimulatedPort>(*board);
  // Stops for ever in the middle of its keep-alive, as a process does that gets SIGKILL.
  class KilledPort : public BytePort {
   public:
    explicit KilledPort(SimulatedPort& port) : port_(port) {}
    [[nodiscard]] std::string Name() const override { return port_.Name(); }
    [[nodiscard]] Status Open() override { return port_.Open(); }
    void Close() noexcept override {}
    [[nodiscard]] Status Write(std::span<const std::uint8_t> bytes) override {
      return dead ? Status{} : port_.Write(bytes);  // nothing reaches the board any more
    }
    [[nodiscard]] Result<std::size_t> Read(std::span<std::uint8_t> buffer,
                                           Duration longest) override {
      return port_.Read(buffer, longest);
    }
    [[nodiscard]] Duration Now() const override { return port_.Now(); }
    void Wait(Duration time) override {
      port_.Wait(time);
      if (port_.Now() > std::chrono::seconds(4) && !dead) {
        dead = true;
        killed_at = port_.Now();
      }
    }
    bool dead = false;
    Duration killed_at{};

   private:
    SimulatedPort& port_;
  };
  auto killed = std::make_unique<KilledPort>(*port);
  KilledPort& handle = *killed;
  SimTime off{};
  board->Watch(
      {.light = [&](const LightChange& change) { off = change.level == 0.0 ? change.time : off; }});
  RigService service(std::make_unique<RigDevices>(std::move(killed), nullptr));
  ASSERT_TRUE(service.RunToEnd(LightJob({.channel = 3, .on_time = seconds(10)}, "test")));
  ASSERT_TRUE(handle.dead);
  EXPECT_GT(off, handle.killed_at);
  EXPECT_LE(off - handle.killed_at, milliseconds(2100));
}

}  // namespace
}  // namespace sateen::testing::daemon_stress_test
