#include <sys/stat.h>

#include <nlohmann/json.hpp>

#include "core/notice.h"
#include "tests/simulation/virtual_rig/capture_fakes.h"
#include "tests/simulation/virtual_rig/program_runs.h"
#include "tests/testing/traced_run.h"
#include "tests/testing/tree.h"

// Files, folders, links and pipes of others lie in and around everything that is written. None of
// them is changed, whatever the programs do there.
namespace sateen::testing::foreign_files_test {
namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;
using ::testing::HasSubstr;

class ForeignFiles : public BoardTest {
 protected:
  ForeignFiles() {
    WriteText(Path("far/notes"), "mine");
    WriteText(Path("far/03-led-2.dng"), "mine");
    WriteText(Path("far/normal.exr"), "mine");
    WriteText(Path("far/deep/notes"), "mine");
    WriteText(Path("rig.json"), RigToJson(CaptureRig()));
    nlohmann::json scene =
        nlohmann::json::parse(ReadText(fs::path(SourceDir()) / "samples/scenes/twill-table.json"));
    scene["rig"] = "rig.json";
    WriteText(Path("scene.json"), scene.dump());
    WriteSpheres(Path("photos"));
    setenv("TMPDIR", Path("tmp").c_str(), 1);
  }
  ~ForeignFiles() override { unsetenv("TMPDIR"); }

  [[nodiscard]] fs::path Path(const std::string& name) const { return temp_.Path() / name; }

  // Everything that could be taken for something else.
  void Plant(const std::string& dir) const {
    for (const char* name :
         {"notes.txt", ".hidden", "folder/notes", "IMG_1.dng", ".sateen-abcdef/notes",
          ".sateen-ghijkl", ".sateen-incoming/00-1/DSC.DNG", ".sateen-incoming-abcdef/notes",
          "sateen-preview-1-0/notes", "sateen-preview-abcdef/notes", "99-led-7.txt"}) {
      WriteText(Path(dir) / name, "mine");
    }
    for (const char* name : {"link", ".sateen-mnopqr", ".sateen-incoming-mnopqr"}) {
      fs::create_directory_symlink(Path("far"), Path(dir) / name);
    }
    fs::create_symlink(Path("far/notes"), Path(dir) / "link.json");
    fs::create_symlink(Path("far/none"), Path(dir) / "broken");
    ASSERT_EQ(mkfifo((Path(dir) / "pipe").c_str(), 0600), 0);
  }
  // What of `before` is another thing now.
  [[nodiscard]] std::vector<std::string> Touched(const Files& before) const {
    const Files now = Tree(temp_.Path());
    std::vector<std::string> touched;
    for (const auto& [name, content] : before) {
      if (const auto found = now.find(name); found == now.end() || found->second != content) {
        touched.push_back(name);
      }
    }
    return touched;
  }
  int Run(const std::vector<std::string>& words) const {
    return RunTraced(Sateen(words, Path("log"))).exit_status;
  }

  Status Capture(Result<CaptureSession> session) {
    if (!session) {
      return tl::unexpected(session.error());
    }
    LightBoard host(std::make_unique<SimulatedPort>(*board_));
    LitCamera camera(*board_, LightImages(CaptureRig()));
    camera.on_exposed = [&](int capture) { cancel_ = !is_resumed_ && capture == 5; };
    return session->Run(host, camera, {.threads = 1, .cancel = &cancel_})
        .map([](const CaptureSummary&) {});
  }
  Result<CaptureSession> Begin() const {
    return CaptureSession::Begin(Path("session"), Path("rig.json"), QuickCapture());
  }
  Status Resume() {
    is_resumed_ = true;
    cancel_ = false;
    return Capture(CaptureSession::Resume(Path("session"), QuickCapture()));
  }

  TempFolder temp_;
  std::atomic<bool> cancel_ = false;
  bool is_resumed_ = false;
};

TEST_F(ForeignFiles, AreNeverTouched) {
  for (const char* dir : {"tmp", "session", "maps", "simulated", "simulated/frames",
                          "simulated/truth", "rigs", "rigs/lights-spheres"}) {
    Plant(dir);
  }
  Files before = Tree(temp_.Path());
  ASSERT_EQ(Capture(Begin()).error().code, ErrorCode::kCancelled);
  EXPECT_THAT(Touched(before), ::testing::IsEmpty()) << "by capture";
  Plant("session/frames");
  for (auto& [name, content] : Tree(Path("session/frames"))) {
    if (content == "file mine") {
      before["session/frames/" + name] = content;
    }
  }

  std::vector<std::string> notices;
  {
    const NoticesTo here([&](const std::string& text) { notices.push_back(text); });
    const Status resumed = Resume();
    ASSERT_TRUE(resumed) << resumed.error().message;
  }
  EXPECT_THAT(Touched(before), ::testing::IsEmpty()) << "by resume";
  ASSERT_EQ(notices.size(), 1U);
  EXPECT_THAT(notices[0], HasSubstr("entries are not of this capture and left alone"));
  EXPECT_EQ(Run({"session", "verify", Path("session")}), 0) << ReadText(Path("log"));
  for (int again = 0; again < 2; ++again) {  // over what the first time left, too
    EXPECT_EQ(Run({"simulate", Path("scene.json"), "-o", Path("simulated")}), 0);
    EXPECT_THAT(Touched(before), ::testing::IsEmpty()) << "by simulate";
    EXPECT_EQ(Run({"solve", Path("simulated"), "-o", Path("maps")}), 0);
    EXPECT_THAT(Touched(before), ::testing::IsEmpty()) << "by solve";
    EXPECT_EQ(Run({"calibrate", "spheres", Path("photos"), "--circles", Path("photos/circles.txt"),
                   "-o", Path("rigs/lights.json")}),
              0);
    EXPECT_THAT(Touched(before), ::testing::IsEmpty()) << "by calibrate";
  }
  fmt::print("{} entries of others, none touched\n", before.size());
}

// A link in each place where one of the programs writes a file or a folder of its own.
TEST_F(ForeignFiles, LinksInPlaceOfOutputsAreNotFollowed) {
  const auto refused = [&](const std::string& place, const std::string& to,
                           const std::vector<std::string>& words, int status) {
    fs::create_directories(Path(place).parent_path());
    fs::create_symlink(Path(to), Path(place));
    const Files before = Tree(temp_.Path());
    EXPECT_EQ(Run(words), status) << place << ": " << ReadText(Path("log"));
    EXPECT_THAT(ReadText(Path("log")), HasSubstr(Path(place).string() + ": is a link")) << place;
    EXPECT_THAT(Touched(before), ::testing::IsEmpty()) << place;
    fs::remove_all(Path("out"));
    fs::remove(Path("log"));
  };
  fs::create_directory(Path("tmp"));
  ASSERT_EQ(Run({"simulate", Path("scene.json"), "-o", Path("simulated")}), 0);
  fs::remove(Path("log"));
  const std::vector<std::string> simulate = {"simulate", Path("scene.json"), "-o", Path("out")};
  refused("out/frames", "far", simulate, 4);
  refused("out/truth", "far", simulate, 4);
  refused("out/session.json", "far/notes", simulate, 4);
  const std::vector<std::string> solve = {"solve", Path("simulated"), "-o", Path("out")};
  refused("out/normal.exr", "far/normal.exr", solve, 4);
  refused("out/solve.json", "far/none", solve, 4);
  const std::vector<std::string> capture = {
      "capture", "--rig", Path("rig.json"), "-o", Path("out"), "--exposure", "20ms", "--dry-run"};
  refused("out/frames", "far", capture, 2);
  refused("out/rig.json", "rig.json", capture, 2);
  refused("out/journal.jsonl", "far/none", capture, 2);
  refused("out/session.json", "far/none", capture, 2);
}

TEST_F(ForeignFiles, ALinkInsteadOfTheFramesOfABegunCaptureIsRefused) {
  ASSERT_EQ(Capture(Begin()).error().code, ErrorCode::kCancelled);
  fs::rename(Path("session/frames"), Path("kept"));
  fs::create_directory_symlink(Path("kept"), Path("session/frames"));
  WriteText(Path("kept/notes"), "mine");
  const Files before = Tree(temp_.Path());

  const Status resumed = Resume();

  ASSERT_FALSE(resumed);
  EXPECT_EQ(resumed.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(resumed.error().message, HasSubstr("session/frames: is a link"));
  EXPECT_EQ(Tree(temp_.Path()), before);
}

}  // namespace
}  // namespace sateen::testing::foreign_files_test
