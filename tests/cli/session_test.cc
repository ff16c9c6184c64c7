#include <gmock/gmock.h>

#include <algorithm>

#include "cli/session_verify.h"
#include "core/sha256.h"
#include "tests/cli/cli_runner.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::session_test {
namespace {

using ::testing::HasSubstr;
using testing::RunResult;
using testing::TempFolder;

RunResult Verify(const std::vector<std::string>& words) {
  std::vector<std::string> all = {"verify"};
  all.insert(all.end(), words.begin(), words.end());
  return testing::RunCommand<cli::SessionVerifyArgs>(all, cli::AddSessionVerify,
                                                     cli::RunSessionVerify);
}

// A session with the hashes of its frames.
void WriteHashed(const std::filesystem::path& dir) {
  Session session = testing::FourLightSession();
  testing::WriteSession(dir, session);
  for (SessionFrame& frame : session.frames) {
    frame.sha256 = *Sha256OfFile(dir / frame.file);
  }
  testing::WriteText(dir / "session.json", SessionToJson(session));
}

TEST(SessionVerify, SaysThatItIsWhole) {
  const TempFolder temp;
  WriteHashed(temp.Path() / "linen");
  const RunResult result = Verify({(temp.Path() / "linen").string()});
  EXPECT_EQ(result.exit_status, 0) << result.log;
  EXPECT_THAT(result.out, HasSubstr("linen is whole: 5 files"));
  const RunResult json = Verify({(temp.Path() / "linen").string(), "--json"});
  EXPECT_EQ(json.Json()["files"], 5);
  EXPECT_EQ(json.Json()["whole"], true);
}

TEST(SessionVerify, ExitsWith3AndNamesWhatIsNot) {
  const TempFolder temp;
  const std::filesystem::path dir = temp.Path() / "linen";
  const auto expect = [&](const std::string& part) {
    const RunResult result = Verify({dir.string()});
    EXPECT_EQ(result.exit_status, 3) << part;
    EXPECT_EQ(result.out, "");
    EXPECT_THAT(result.log, HasSubstr(part));
  };
  WriteHashed(dir);
  testing::WriteFlat(dir / "frames" / "west.exr", 0.5F);
  expect("west.exr: its SHA-256");
  std::filesystem::remove(dir / "frames" / "west.exr");
  expect("west.exr");
  Session session = testing::FourLightSession();
  testing::WriteText(dir / "session.json", SessionToJson(session));
  expect("frames/east.exr has no hash");
  session.frames.erase(session.frames.begin());
  testing::WriteText(dir / "session.json", SessionToJson(session));
  expect("has no frame of light 'east'");
}

TEST(SessionVerify, TellsOfAllFaultsAtOnce) {
  const TempFolder temp;
  const std::filesystem::path dir = temp.Path() / "linen";
  WriteHashed(dir);
  testing::WriteFlat(dir / "frames" / "west.exr", 0.5F);
  std::filesystem::remove(dir / "frames" / "east.exr");
  const RunResult text = Verify({dir.string()});
  EXPECT_EQ(std::ranges::count(text.log, '\n'), 2);
  EXPECT_THAT(text.log, HasSubstr("west.exr: its SHA-256"));
  EXPECT_THAT(text.log, HasSubstr("east.exr"));
  const RunResult json = Verify({dir.string(), "--json"});
  EXPECT_EQ(json.exit_status, 3);
  EXPECT_EQ(json.Json()["whole"], false);
  EXPECT_EQ(json.Json()["files"], 3);
  EXPECT_EQ(json.Json()["faults"].size(), 2U);
}

TEST(SessionVerify, AFolderThatIsNotThereIsExitStatus4) {
  const RunResult result = Verify({"/nowhere/linen", "--json"});
  EXPECT_EQ(result.exit_status, 4);
  EXPECT_THAT(result.log, HasSubstr("/nowhere/linen: there is no such folder"));
  EXPECT_EQ(result.Json()["whole"], false);
  EXPECT_EQ(result.Json()["faults"].size(), 1U);
}

TEST(SessionVerify, NeedsASession) { EXPECT_EQ(Verify({}).exit_status, 2); }

}  // namespace
}  // namespace sateen::session_test
