#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/files/file_io.h"
#include "core/stray_thread.h"
#include "pipelines/simulate/simulate.h"
#include "rig/rig.h"
#include "scanner/daemon/http/listener.h"
#include "simulation/rigs.h"
#include "tests/scanner/daemon/daemon_fakes.h"
#include "tests/testing/files.h"

// Files that are none, in every place of a request that takes a path: each is refused, none is
// waited for, and the daemon goes on.
namespace sateen::special_files_test {
namespace {

using nlohmann::json;
using testing::FakeDaemon;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::WriteText;

namespace fs = std::filesystem;

constexpr const char* kScene = R"({
  "schema": "sateen.scene/1", "rig": "rig.json",
  "surface": {"shape": "sphere", "radius_mm": 240, "edge_deg": 30},
  "materials": {"surface": {"albedo": [0.6, 0.5, 0.4]}}})";

struct Call {
  std::string path;
  json body;  // right, but for what is put into it
};

std::set<std::string> WordsOfApiPage() {
  const std::string page =
      ReadFileBytes(fs::path(testing::SourceDir()) / "docs" / "api.md").value_or("");
  std::set<std::string> words;
  std::string word;
  for (const char c : page) {
    if ((c >= 'a' && c <= 'z') || c == '_') {
      word += c;
    } else {
      words.insert(std::exchange(word, std::string()));
    }
  }
  return words;
}

class SpecialFilesTest : public ::testing::Test {
 protected:
  SpecialFilesTest() {
    WriteText(Path("rig.json"), RigToJson(RingRig({24, 16}, LightModel::kNear, 200.0)));
    WriteText(Path("scene.json"), kScene);
    EXPECT_TRUE(SimulateSession({.scene = Path("scene.json"),
                                 .output = Path("session"),
                                 .format = FrameFormat::kLinearExr}));
    MakeFiles();
  }

  void MakeFiles() {
    EXPECT_EQ(mkfifo(Path("fifo.jpg").c_str(), 0600), 0);
    files_["FIFO"] = Path("fifo.jpg");
    files_["device"] = "/dev/zero";
    files_["socket"] = Path("socket.jpg");
    fs::create_directory(Path("empty.jpg"));
    files_["directory"] = Path("empty.jpg");
    fs::create_symlink("loop.jpg", Path("loop.jpg"));
    files_["link loop"] = Path("loop.jpg");
    fs::create_symlink("fifo.jpg", Path("link.jpg"));
    files_["link to a FIFO"] = Path("link.jpg");
    if (geteuid() != 0) {
      WriteText(Path("unreadable.jpg"), "{}");
      chmod(Path("unreadable.jpg").c_str(), 0);
      files_["unreadable file"] = Path("unreadable.jpg");
    }
  }

  [[nodiscard]] fs::path Path(const std::string& name) const { return folder_.Path() / name; }

  [[nodiscard]] std::vector<Call> Calls() const {
    const std::string rig = Path("rig.json").string();
    return {
        {"/v1/jobs", {{"kind", "capture"}, {"rig", rig}, {"output", Path("new").string()}}},
        {"/v1/jobs",
         {{"kind", "capture"}, {"dry_run", true}, {"rig", rig}, {"output", Path("new").string()}}},
        {"/v1/jobs", {{"kind", "capture"}, {"resume", true}, {"output", Path("session").string()}}},
        {"/v1/jobs", {{"kind", "preview"}, {"rig", rig}, {"output", Path("look.jpg").string()}}},
        {"/v1/preview", {{"rig", rig}, {"output", Path("look.jpg").string()}}},
        {"/v1/jobs",
         {{"kind", "solve"},
          {"capture", Path("session").string()},
          {"rig", rig},
          {"output", Path("maps").string()}}},
        {"/v1/board", json::object()},
        {"/v1/lights/3", json::object()}};
  }

  // Returns the keys of the call that take a path: they refuse one that is not absolute.
  [[nodiscard]] std::vector<std::string> PathKeys(const Call& call) const {
    static const std::set<std::string> words = WordsOfApiPage();
    std::vector<std::string> keys;
    for (const std::string& word : words) {
      json body = call.body;
      body[word] = "relative";
      const ApiResponse answer = daemon_.Ask("POST", call.path, body.dump());
      if (answer.body.find("need an absolute path") != std::string::npos) {
        keys.push_back(word);
      }
    }
    return keys;
  }

  // Returns how the call ended: its error, or that of its job.
  [[nodiscard]] std::string Outcome(const Call& call) const {
    const ApiResponse answer = daemon_.Ask("POST", call.path, call.body.dump());
    if (answer.status != 202) {
      return answer.status < 300 ? "done" : answer.body;
    }
    const std::uint64_t id = json::parse(answer.body).at("id");
    const std::vector<JobEvent> events = testing::AllEvents(daemon_.service, id);
    const std::string end = events.empty() ? "" : events.back().type;
    return end == "failed" ? events.back().data : end == "done" ? "done" : "no end";
  }

  // Returns the number of stray threads, once there are no more than `before` or after a long wait.
  [[nodiscard]] static int StrayThreadsAfter(int before) {
    const auto until = std::chrono::steady_clock::now() + testing::kLong;
    while (StrayThreads() > before && std::chrono::steady_clock::now() < until) {
      std::this_thread::yield();
    }
    return StrayThreads();
  }

  testing::TempFolder folder_;
  const Result<Listener> socket_ = Listener::OnUnixSocket(folder_.Path() / "socket.jpg");
  std::map<std::string, fs::path> files_;
  FakeDaemon daemon_;
};

TEST_F(SpecialFilesTest, AreRefusedInEveryPlaceOfEveryRequest) {
  daemon_.rig.held = false;
  const int stray = StrayThreads();
  std::map<std::string, int> places;
  for (const Call& call : Calls()) {
    for (const std::string& key : PathKeys(call)) {
      ++places[key];
      for (const auto& [what, file] : files_) {
        Call with = call;
        with.body[key] = file.string();
        SCOPED_TRACE(with.path + " " + with.body.dump() + " " + what);
        const std::string outcome = Outcome(with);
        // Given up is not refused: a thread still waits for the file.
        ASSERT_THAT(outcome, Not(HasSubstr("was not read within")));
        ASSERT_NE(outcome, "no end");
        if (what == "directory" && key == "output") {
          continue;  // may be written into
        }
        EXPECT_NE(outcome, "done");
        EXPECT_TRUE(json::accept(outcome)) << outcome;
      }
    }
  }
  EXPECT_EQ(StrayThreadsAfter(stray), stray) << "a thread still waits for a file";
  // Where this list is shorter than docs/api.md says, the search above finds too little.
  for (const char* key : {"rig", "output", "capture", "mask", "truth"}) {
    EXPECT_GT(places[key], 0) << key;
  }
  EXPECT_EQ(places["rig"], 6);
  EXPECT_EQ(daemon_.Ask("POST", "/v1/lights/off").status, 200);
  EXPECT_EQ(fs::status(Path("fifo.jpg")).type(), fs::file_type::fifo);
}

}  // namespace
}  // namespace sateen::special_files_test
