#include "scanner/sessions/files/text_table.h"

#include <map>

#include "core/sha256.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::text_table_test {
namespace {

using ::testing::ElementsAre;
using testing::IsError;
using testing::TempFolder;
using testing::WriteText;

Result<std::vector<NumberRow>> RowsOf(const std::string& text) {
  const TempFolder temp;
  WriteText(temp.Path() / "t.txt", text);
  std::map<std::string, std::string> hashes;
  return ReadNumberRows(temp.Path() / "t.txt", hashes);
}

TEST(ReadTextLines, AcceptsWhatEditorsOfAnySystemLeave) {
  const TempFolder temp;
  const std::string text =
      "\xEF\xBB\xBF"
      "one two\r\n\r\n\t three\t \n\n  \n";
  WriteText(temp.Path() / "t.txt", text);
  std::map<std::string, std::string> hashes;

  const std::vector<TextLine> lines = ReadTextLines(temp.Path() / "t.txt", hashes).value();

  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0].text, "one two");
  EXPECT_EQ(lines[1].text, "three");
  EXPECT_EQ(lines[1].number, 3);
  EXPECT_EQ(hashes.at((temp.Path() / "t.txt").string()), Sha256(text));
}

TEST(ReadTextLines, SaysThatAFileIsAbsent) {
  std::map<std::string, std::string> hashes;
  const auto lines = ReadTextLines("/nonexistent/t.txt", hashes);
  ASSERT_FALSE(lines);
  EXPECT_THAT(lines.error(), IsError(ErrorCode::kIo, "/nonexistent/t.txt"));
}

TEST(SplitWords, DividesAtBlanksAndTabs) {
  EXPECT_THAT(SplitWords(" a\tb  c d "), ElementsAre("a", "b", "c", "d"));
  EXPECT_TRUE(SplitWords(" \t ").empty());
}

TEST(ReadNumberRows, ReadsEveryUsualFormOfANumber) {
  const auto rows = RowsOf("1 -2.5 +0.5\n.5 1e-3 -1.0E+2\n");
  ASSERT_TRUE(rows) << rows.error().message;
  EXPECT_THAT((*rows)[0].values, ElementsAre(1, -2.5, 0.5));
  EXPECT_THAT((*rows)[1].values, ElementsAre(0.5, 1e-3, -100));
}

TEST(ReadNumberRows, NamesTheWordThatIsNoFiniteNumberAndItsLine) {
  for (const char* word :
       {"abc", "1,5", "nan", "inf", "1e999", "0x10", "1.2.3", "+", "+-1", "--1"}) {
    const auto rows = RowsOf(fmt::format("1 2 3\n\n4 {} 6\n", word));
    ASSERT_FALSE(rows) << word;
    EXPECT_THAT(rows.error(),
                IsError(ErrorCode::kBadData, fmt::format("t.txt:3: found '{}'", word)));
  }
}

TEST(ReadNumberRows, ShowsBinaryContentAsPrintableText) {
  const auto rows = RowsOf(std::string("\xFF\xFE\x00\x01zz", 6) + std::string(100, 'q'));
  ASSERT_FALSE(rows);
  EXPECT_THAT(rows.error(),
              IsError(ErrorCode::kBadData, "found '????zz" + std::string(34, 'q') + "...'"));
}

}  // namespace
}  // namespace sateen::text_table_test
