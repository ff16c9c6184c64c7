#include "core/files/input_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file_io.h"
#include "core/json.h"
#include "core/sha256.h"
#include "tests/testing/files.h"
#include "tests/testing/special_files.h"

namespace sateen::input_file_test {
namespace {

using ::testing::HasSubstr;
using testing::TempFolder;
using testing::WriteText;

TEST(InputFile, ReadsAnyPartThroughLinks) {
  const TempFolder folder;
  WriteText(folder.Path() / "file", "0123456789");
  std::filesystem::create_symlink("file", folder.Path() / "link");
  const Result<InputFile> file = InputFile::Open(folder.Path() / "link");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->Bytes(), 10U);
  EXPECT_EQ(file->Path(), folder.Path() / "link");
  std::string part(4, '?');
  EXPECT_EQ(file->ReadAt(3, part).value(), 4U);
  EXPECT_EQ(part, "3456");
  EXPECT_EQ(file->ReadAt(8, part).value(), 2U);
  EXPECT_EQ(file->ReadAt(10, part).value(), 0U);
  EXPECT_EQ(file->ReadAt(uint64_t{1} << 40, part).value(), 0U);
}

// A library that opens by name reads the file that was checked and not one put in its place.
TEST(InputFile, GivesLibrariesTheFileThatWasOpened) {
  const TempFolder folder;
  WriteText(folder.Path() / "file", "first");
  const Result<InputFile> file = InputFile::Open(folder.Path() / "file");
  ASSERT_TRUE(file);
  WriteText(folder.Path() / "other", "second");
  std::filesystem::rename(folder.Path() / "other", folder.Path() / "file");
  EXPECT_EQ(ReadFileBytes(file->LibraryName()).value(), "first");
}

// Were a pipe opened for waiting, this test would hang.
TEST(InputFile, RefusesAllButFiles) {
  const TempFolder folder;
  for (const testing::SpecialFile& special : testing::MakeSpecialFiles(folder.Path())) {
    const Result<InputFile> file = InputFile::Open(special.path);
    ASSERT_FALSE(file) << special.path;
    EXPECT_EQ(file.error().code, ErrorCode::kIo);
    EXPECT_THAT(file.error().message, HasSubstr(special.path.string() + ": "));
    EXPECT_THAT(file.error().message, HasSubstr(special.reason));
    EXPECT_EQ(ReadFileBytes(special.path).error().message, file.error().message);
    EXPECT_EQ(Sha256OfFile(special.path).error().message, file.error().message);
    EXPECT_EQ(ReadJsonFile(special.path, "any", 1).error().message, file.error().message);
  }
}

TEST(ReadFileBytes, GivesEveryByte) {
  const TempFolder folder;
  for (const size_t count : {0, 1, 1 << 20, (1 << 20) + 1, 2'500'000}) {
    std::string bytes(count, '\0');  // several pieces, with zeros and newlines
    for (size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<char>(i % 251);
    }
    WriteText(folder.Path() / "frame.raw", bytes);
    EXPECT_EQ(ReadFileBytes(folder.Path() / "frame.raw").value(), bytes);
    EXPECT_EQ(Sha256OfFile(folder.Path() / "frame.raw").value(), Sha256(bytes)) << count;
  }
}

TEST(ReadFileBytes, RefusesWhatIsTooLong) {
  const TempFolder folder;
  WriteText(folder.Path() / "long", "0123456789");
  EXPECT_EQ(ReadFileBytes(folder.Path() / "long", 10).value(), "0123456789");
  const Result<std::string> bytes = ReadFileBytes(folder.Path() / "long", 9);
  ASSERT_FALSE(bytes);
  EXPECT_EQ(bytes.error().code, ErrorCode::kBadData);
  EXPECT_THAT(bytes.error().message, HasSubstr("it has 10 bytes, and at most 9 are read"));
  // A file of 2^40 bytes, all of them a hole, is not read to its end.
  std::filesystem::resize_file(folder.Path() / "long", uint64_t{1} << 40);
  EXPECT_THAT(ReadFileBytes(folder.Path() / "long").error().message,
              HasSubstr("it has 1099511627776 bytes, and at most 8388608 are read"));
  // A file that says 0 bytes and has more.
  EXPECT_THAT(ReadFileBytes("/proc/self/status").value(), HasSubstr("Pid:"));
  EXPECT_FALSE(ReadFileBytes("/proc/self/status", 100));
}

}  // namespace
}  // namespace sateen::input_file_test
