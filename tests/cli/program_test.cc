#include "cli/program.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "core/printable.h"
#include "tests/testing/files.h"

namespace sateen::program_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

struct Outcome {
  int exit_status = 0;
  std::string out;
  std::string log;
};

Outcome RunSateen(std::vector<const char*> words) {
  words.insert(words.begin(), "sateen");
  std::ostringstream out;
  std::ostringstream log;
  const int status =
      cli::RunProgram(static_cast<int>(words.size()), words.data(), Task{}, out, log);
  return {status, out.str(), log.str()};
}

const std::vector<std::vector<const char*>> kCommands = {{"solve"},
                                                         {"simulate"},
                                                         {"calibrate", "lens"},
                                                         {"calibrate", "pose"},
                                                         {"calibrate", "response"},
                                                         {"calibrate", "lights"},
                                                         {"calibrate", "check"},
                                                         {"calibrate", "spheres"},
                                                         {"board", "print"},
                                                         {"capture"},
                                                         {"preview"},
                                                         {"light"},
                                                         {"devices"},
                                                         {"serve"},
                                                         {"session", "verify"},
                                                         {"session", "overview"},
                                                         {"bench", "solve"},
                                                         {"bench", "accuracy"},
                                                         {"bench", "simulate"},
                                                         {"bench", "calibrate"}};

TEST(Program, HelpOfEachCommandFitsAHundredColumns) {
  for (std::vector<const char*> words : kCommands) {
    words.push_back("--help");
    const Outcome help = RunSateen(words);
    EXPECT_EQ(help.exit_status, 0) << words[0];
    EXPECT_THAT(help.out, HasSubstr("Options:")) << words[0];
    std::istringstream lines(help.out);
    for (std::string line; std::getline(lines, line);) {
      EXPECT_LE(line.size(), 100U) << line;
    }
  }
}

TEST(Program, WrappedHelpKeepsItsWordsAndTheirColumn) {
  const Outcome help = RunSateen({"serve", "--help"});
  EXPECT_THAT(help.out, HasSubstr("\n                              "));
  EXPECT_THAT(RunSateen({"--help"}).out, HasSubstr("5 device, 6 cancelled."));
}

// Each runs its own command and no other: the command names itself in its error.
TEST(Program, RunsTheCommandThatIsTyped) {
  const Outcome solve = RunSateen({"solve", "/nonexistent/session", "-o", "/nonexistent/maps"});
  EXPECT_EQ(solve.exit_status, 4);
  EXPECT_THAT(solve.log, StartsWith("sateen solve: error: "));
  const Outcome verify = RunSateen({"session", "verify", "/nonexistent/session"});
  EXPECT_EQ(verify.exit_status, 4);
  EXPECT_THAT(verify.log, StartsWith("sateen session verify: error: "));
  const Outcome overview =
      RunSateen({"session", "overview", "/nonexistent/session", "-o", "/nonexistent/sheet.png"});
  EXPECT_EQ(overview.exit_status, 4);
  EXPECT_THAT(overview.log, StartsWith("sateen session overview: error: "));
  const Outcome board =
      RunSateen({"board", "print", "hexagons:1x1", "-o", "/nonexistent/board.pdf"});
  EXPECT_EQ(board.exit_status, 2);
  EXPECT_THAT(board.log, StartsWith("sateen board print: error: "));
}

// A terminal would obey: clear its screen, change its title, type a line.
TEST(Program, NoNameReachesTheTerminalAsAnEscape) {
  const testing::TempFolder temp;
  const std::string name =
      "led\x1b]0;title\a\x1b[2J\xc2\x9b"
      "5n\x7f\r\xff";
  const std::filesystem::path folder = temp.Path() / name;
  std::filesystem::create_directory(folder);
  const std::string path = folder.string();
  const std::string rig = (folder / "rig.json").string();
  testing::WriteText(folder / "session.json", R"({"schema":"\u001b[31m\u009b/1"})");
  testing::WriteText(folder / "rig.json",
                     R"({"schema":"sateen.rig/1","lights":[{"name":"\u001b[2J\u009b1m"}]})");
  for (const std::vector<const char*>& words : std::vector<std::vector<const char*>>{
           {"solve", path.c_str(), "-o", "/nonexistent/maps"},
           {"session", "verify", path.c_str()},
           {"calibrate", "check", path.c_str()},
           {"simulate", path.c_str(), "-o", "/nonexistent/session"},
           {"light", name.c_str(), "--level", name.c_str()},
           {"light", name.c_str(), "--port", path.c_str()},
           {"light", name.c_str(), "--port", "/nonexistent", "--rig", rig.c_str()},
           {name.c_str()}}) {
    const Outcome run = RunSateen(words);
    EXPECT_NE(run.exit_status, 0) << words[0];
    const std::string text = run.out + run.log;
    EXPECT_EQ(text, Printable(text)) << words[0];
  }
}

TEST(Program, AWrongCommandLineIsStatusTwo) {
  EXPECT_EQ(RunSateen({}).exit_status, 2);
  EXPECT_EQ(RunSateen({"weave"}).exit_status, 2);
  EXPECT_EQ(RunSateen({"calibrate"}).exit_status, 2);
  const Outcome run = RunSateen({"solve", "session", "-o", "maps", "--robust", "l1"});
  EXPECT_EQ(run.exit_status, 2);
  EXPECT_THAT(run.log, StartsWith("sateen: error: "));
  EXPECT_THAT(run.log, HasSubstr("{auto,least-squares,robust,none}"));
}

}  // namespace
}  // namespace sateen::program_test
