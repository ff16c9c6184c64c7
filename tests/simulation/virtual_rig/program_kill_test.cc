#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/files/file_io.h"
#include "scanner/capture/session_proof.h"
#include "tests/simulation/virtual_rig/capture_fakes.h"
#include "tests/simulation/virtual_rig/program_runs.h"
#include "tests/testing/traced_run.h"
#include "tests/testing/tree.h"

// capture, resume, solve, simulate and calibrate, killed as by kill -9 at system calls that change
// files. After each kill nothing is lost that was there, and the next run leaves what an undisturbed
// one leaves, and nothing else. SATEEN_KILLS is the number of kills for each of them; 0: at every
// call.
namespace sateen::testing::program_kill_test {
namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;

constexpr int kQuickKills = 4;

int Kills() {
  const char* kills = std::getenv("SATEEN_KILLS");
  return kills != nullptr ? std::atoi(kills) : kQuickKills;
}

class ProgramKill : public BoardTest {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TempFolder();
    Rig rig = CaptureRig();
    WriteText(shared_->Path() / "rig.json", RigToJson(rig));
    nlohmann::json scene =
        nlohmann::json::parse(ReadText(fs::path(SourceDir()) / "samples/scenes/twill-table.json"));
    scene["rig"] = "rig.json";
    WriteText(shared_->Path() / "scene.json", scene.dump());
    ASSERT_EQ(Run(Sateen({"simulate", Shared("scene.json"), "-o", Shared("session")})), 0);
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }

  static std::string Shared(const std::string& name) { return shared_->Path() / name; }

  static int Run(const std::function<int()>& body) { return RunTraced(body).exit_status; }

  struct Law {
    std::function<void(const fs::path& dir)> prepare = [](const fs::path&) {};
    std::function<std::function<int()>(const fs::path& dir)> body;
    // What must hold after the kill; it may run the program.
    std::function<void(const fs::path& dir, const fs::path& undisturbed)> holds;
  };

  // Kills `body` here and there, evenly; says how often.
  void KillAtCalls(const char* name, const Law& law) {
    const fs::path undisturbed = temp_.Path() / "undisturbed" / "here";
    law.prepare(undisturbed);
    const TracedRun whole = RunTraced(law.body(undisturbed));
    ASSERT_EQ(whole.exit_status, 0) << name;
    ASSERT_GT(whole.calls, 10) << name;
    const int kills = Kills() > 0 ? std::min(Kills(), whole.calls) : whole.calls;
    int killed = 0;
    for (int kill = 0; kill < kills; ++kill) {
      const int at = whole.calls * kill / kills;
      const fs::path dir = temp_.Path() / fmt::format("{}-{}", name, at) / "here";
      law.prepare(dir);
      const TracedRun run = RunTraced(law.body(dir), at);
      killed += run.is_killed ? 1 : 0;  // threads may make some calls fewer than the time before
      SCOPED_TRACE(fmt::format("{} killed at call {} of {}", name, at, whole.calls));
      law.holds(dir, undisturbed);
      if (HasFatalFailure() || HasNonfatalFailure()) {
        return;
      }
      fs::remove_all(dir.parent_path());
    }
    fmt::print("{}: killed at {} of {} system calls that change files\n", name, killed,
               whole.calls);
    EXPECT_GE(killed, kills - kills / 8);
  }

  // The bytes of every file, but of records only that they are there: they hold times and paths.
  static Files FilesOf(const fs::path& dir) {
    Files files = Tree(dir);
    for (auto& [name, content] : files) {
      if (name.ends_with("solve.json") || name.ends_with("journal.jsonl")) {
        content = "record";
      }
    }
    return files;
  }

  // Goes on where a capture was begun, else begins.
  Status Capture(const fs::path& dir) {
    LightBoard host(std::make_unique<SimulatedPort>(*board_));
    LitCamera camera(*board_, images_);
    camera.exposure_counts = !options_.exposure_s.has_value();
    camera.times_s = ThirdStops();
    const bool begun =
        fs::exists(dir / kJournalFile) && ReadJournal(dir).value_or(std::nullopt).has_value();
    return (begun ? CaptureSession::Resume(dir, options_)
                  : CaptureSession::Begin(dir, Shared("rig.json"), options_))
        .and_then([&](CaptureSession session) {
          return session.Record().complete ? session.Finish()
                                           : session.Run(host, camera, {.threads = 1});
        })
        .and_then([&](const CaptureSummary&) { return VerifySession(dir, {}); })
        .map([](int) {});
  }
  std::function<int()> CaptureInto(const fs::path& dir) {
    return [this, dir] {
      const Status captured = Capture(dir);
      if (!captured) {
        fmt::print(stderr, "{}\n", captured.error().message);
      }
      return captured ? 0 : 1;
    };
  }

  static TempFolder* shared_;
  TempFolder temp_;
  CaptureOptions options_ = QuickCapture();
  std::vector<Image3> images_ = LightImages(CaptureRig());
};
TempFolder* ProgramKill::shared_ = nullptr;

TEST_F(ProgramKill, CaptureIsResumed) {
  KillAtCalls("capture", {.body = [&](const fs::path& dir) { return CaptureInto(dir); },
                          .holds =
                              [&](const fs::path& dir, const fs::path& undisturbed) {
                                ASSERT_EQ(Run(CaptureInto(dir)), 0);
                                EXPECT_EQ(FilesOf(dir), FilesOf(undisturbed));
                              }});
}

TEST_F(ProgramKill, CaptureThatMetersIsResumed) {
  options_.exposure_s.reset();
  KillAtCalls("metering", {.body = [&](const fs::path& dir) { return CaptureInto(dir); },
                           .holds =
                               [&](const fs::path& dir, const fs::path& undisturbed) {
                                 ASSERT_EQ(Run(CaptureInto(dir)), 0);
                                 EXPECT_EQ(FilesOf(dir), FilesOf(undisturbed));
                               }});
}

TEST_F(ProgramKill, ResumeIsResumed) {
  const fs::path begun = temp_.Path() / "begun";
  ASSERT_TRUE(RunTraced(CaptureInto(begun), 60).is_killed);
  KillAtCalls("resume", {.prepare =
                             [&](const fs::path& dir) {
                               fs::create_directories(dir.parent_path());
                               fs::copy(begun, dir, fs::copy_options::recursive);
                             },
                         .body = [&](const fs::path& dir) { return CaptureInto(dir); },
                         .holds =
                             [&](const fs::path& dir, const fs::path& undisturbed) {
                               ASSERT_EQ(Run(CaptureInto(dir)), 0);
                               EXPECT_EQ(FilesOf(dir), FilesOf(undisturbed));
                             }});
}

TEST_F(ProgramKill, SolveKeepsFormerMapsOrHasAllNewOnes) {
  const fs::path former = temp_.Path() / "former";
  const auto solve = [](const fs::path& dir, const std::string& session, const char* robust) {
    return Sateen({"solve", session, "-o", dir, "--robust", robust});
  };
  ASSERT_EQ(Run(solve(former, Shared("session"), "none")), 0);
  KillAtCalls("solve",
              {.prepare =
                   [&](const fs::path& dir) {
                     fs::create_directories(dir.parent_path());
                     fs::copy(former, dir, fs::copy_options::recursive);
                     WriteText(dir / "notes.txt", "mine");
                   },
               .body = [&](const fs::path& dir) { return solve(dir, Shared("session"), "auto"); },
               .holds =
                   [&](const fs::path& dir, const fs::path& undisturbed) {
                     EXPECT_NE(Run(solve(dir, Shared("none"), "auto")), 0);  // it cleans up
                     Files with_notes = FilesOf(former);
                     with_notes["notes.txt"] = "file mine";
                     EXPECT_THAT(FilesOf(dir), ::testing::AnyOf(with_notes, FilesOf(undisturbed)));
                     ASSERT_EQ(Run(solve(dir, Shared("session"), "auto")), 0);
                     EXPECT_EQ(FilesOf(dir), FilesOf(undisturbed));
                   }});
}

TEST_F(ProgramKill, SimulateIsDoneAgain) {
  const auto simulate = [](const fs::path& dir) {
    return Sateen({"simulate", Shared("scene.json"), "-o", dir});
  };
  KillAtCalls("simulate",
              {.body = simulate, .holds = [&](const fs::path& dir, const fs::path& undisturbed) {
                 ASSERT_EQ(Run(simulate(dir)), 0);
                 EXPECT_EQ(FilesOf(dir), FilesOf(undisturbed));
               }});
}

// Returns the rigs in `dir` by their file; all must be whole.
std::map<std::string, size_t> RigsIn(const fs::path& dir) {
  std::map<std::string, size_t> lights;
  for (const auto& entry : fs::directory_iterator(dir)) {
    if (entry.path().extension() == ".json") {
      const Result<Rig> rig = ReadRig(entry.path());
      EXPECT_TRUE(rig) << rig.error().message;
      lights[entry.path().filename()] = rig ? rig->lights.size() : 0;
    }
  }
  return lights;
}

TEST_F(ProgramKill, CalibrateKeepsAWholeRigAtEveryMoment) {
  const std::string photos = temp_.Path() / "photos";
  WriteSpheres(photos);
  const auto calibrate = [&](const fs::path& dir) {
    return Sateen({"calibrate", "spheres", photos, "--circles", photos + "/circles.txt", "-o",
                   dir / "lights.json"});
  };
  const size_t former_lights = CaptureRig().lights.size();
  KillAtCalls("calibrate",
              {.prepare =
                   [&](const fs::path& dir) {
                     WriteText(dir / "lights.json", ReadText(Shared("rig.json")));
                   },
               .body = calibrate,
               .holds =
                   [&](const fs::path& dir, const fs::path& undisturbed) {
                     EXPECT_EQ(RigsIn(dir).count("lights.json"), 1);
                     ASSERT_EQ(Run(calibrate(dir)), 0);
                     std::map<std::string, size_t> rigs = RigsIn(dir);
                     EXPECT_NE(rigs.at("lights.json"), former_lights);
                     rigs.erase("lights.json");
                     EXPECT_THAT(rigs, ::testing::Contains(::testing::Pair(
                                           ::testing::StartsWith("lights-20"), former_lights)));
                     EXPECT_EQ(Listing(dir / "lights-spheres"),
                               Listing(undisturbed / "lights-spheres"));
                     EXPECT_THAT(Listing(dir),
                                 ::testing::Each(::testing::Not(::testing::HasSubstr(".sateen"))));
                   }});
}

}  // namespace
}  // namespace sateen::testing::program_kill_test
