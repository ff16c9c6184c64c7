#include "core/files/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/files/file_exchange.h"
#include "core/files/own_folder.h"
#include "core/notice.h"
#include "tests/testing/files.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/tree.h"

namespace {

int renames_left = -1;       // until the process is killed; below 0: never
int renames_that_work = -1;  // until the disk fails; below 0: always

}  // namespace

// Replaced in this program alone.
extern "C" int rename(const char* from, const char* to) {
  if (renames_left-- == 0) {
    _exit(77);
  }
  if (renames_that_work == 0) {
    errno = EIO;
    return -1;
  }
  renames_that_work -= renames_that_work > 0 ? 1 : 0;
  return static_cast<int>(syscall(SYS_rename, from, to));
}

extern "C" int fsync(int file) {
  if (renames_that_work == 0) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(syscall(SYS_fsync, file));
}

namespace sateen::output_folder_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::Listing;

namespace fs = std::filesystem;

constexpr fs::perms kReadOnly = static_cast<fs::perms>(0555);

std::string Text(const fs::path& path) { return ReadFileBytes(path).value_or("(absent)"); }

// Permissions do not bind root, as whom tests may run; this user they bind.
class AsNobody {
 public:
  AsNobody() : was_(geteuid()) { EXPECT_TRUE(was_ != 0 || seteuid(65534) == 0); }
  AsNobody(const AsNobody&) = delete;
  AsNobody& operator=(const AsNobody&) = delete;
  ~AsNobody() { EXPECT_EQ(seteuid(was_), 0); }

 private:
  uid_t was_;
};

class OutputFolderTest : public ::testing::Test {
 protected:
  const testing::TempFolder temp_;
  const fs::path dir_ = temp_.Path() / "maps" / "linen";
};

TEST_F(OutputFolderTest, CommitPutsEveryFileInPlaceAndLeavesNothingElse) {
  OutputFolder folder = OutputFolder::Open(dir_).value();
  testing::WriteText(folder.Stage("truth/normal.exr"), "normal");
  ASSERT_TRUE(folder.WriteText("solve.json", "record"));
  ASSERT_TRUE(folder.Commit());

  EXPECT_THAT(Listing(dir_), ElementsAre("solve.json", "truth", "truth/normal.exr"));
  EXPECT_EQ(Text(dir_ / "truth/normal.exr"), "normal");
  EXPECT_EQ(Text(dir_ / "solve.json"), "record");
}

TEST_F(OutputFolderTest, NothingIsLeftWithoutCommit) {
  {
    OutputFolder folder = OutputFolder::Open(dir_).value();
    ASSERT_TRUE(folder.WriteText("truth/normal.exr", "normal"));
    EXPECT_TRUE(fs::exists(dir_));
  }
  EXPECT_THAT(Listing(temp_.Path()), IsEmpty());
}

TEST_F(OutputFolderTest, NothingIsVisibleBeforeCommit) {
  OutputFolder folder = OutputFolder::Open(dir_).value();
  ASSERT_TRUE(folder.WriteText("normal.exr", "normal"));

  for (const auto& entry : fs::directory_iterator(dir_)) {
    EXPECT_THAT(entry.path().filename().string(), ::testing::StartsWith("."));
  }
}

TEST_F(OutputFolderTest, OldFilesAreUntouchedWithoutCommit) {
  testing::WriteText(dir_ / "solve.json", "old");
  testing::WriteText(dir_ / "notes.txt", "mine");
  {
    OutputFolder folder = OutputFolder::Open(dir_).value();
    ASSERT_TRUE(folder.WriteText("solve.json", "new"));
    EXPECT_EQ(Text(dir_ / "solve.json"), "old");
  }
  EXPECT_THAT(Listing(dir_), ElementsAre("notes.txt", "solve.json"));
  EXPECT_EQ(Text(dir_ / "solve.json"), "old");
}

TEST_F(OutputFolderTest, CommitReplacesItsOwnFilesOnly) {
  testing::WriteText(dir_ / "solve.json", "old");
  testing::WriteText(dir_ / "notes.txt", "mine");
  OutputFolder folder = OutputFolder::Open(dir_).value();
  ASSERT_TRUE(folder.WriteText("solve.json", "new"));
  ASSERT_TRUE(folder.Commit());

  EXPECT_THAT(Listing(dir_), ElementsAre("notes.txt", "solve.json"));
  EXPECT_EQ(Text(dir_ / "solve.json"), "new");
  EXPECT_EQ(Text(dir_ / "notes.txt"), "mine");
}

TEST_F(OutputFolderTest, CommitTakesAwayWhatIsRetired) {
  testing::WriteText(dir_ / "error.exr", "old");
  testing::WriteText(dir_ / "notes.txt", "mine");
  OutputFolder folder = OutputFolder::Open(dir_).value();
  ASSERT_TRUE(folder.WriteText("normal.exr", "new"));
  folder.Retire("error.exr");
  folder.Retire("never-was.exr");
  EXPECT_TRUE(fs::exists(dir_ / "error.exr"));  // not before

  ASSERT_TRUE(folder.Commit());

  EXPECT_FALSE(fs::exists(dir_ / "error.exr"));
  EXPECT_TRUE(fs::exists(dir_ / "normal.exr"));
  EXPECT_TRUE(fs::exists(dir_ / "notes.txt"));
}

TEST_F(OutputFolderTest, ErrorsSpeakOfThePlaceThatTheUserKnows) {
  OutputFolder folder = OutputFolder::Open(dir_).value();
  const std::string staged = folder.Stage("normal.exr").string();

  const Error error = folder.InPlace({ErrorCode::kIo, staged + ": full, " + staged});

  EXPECT_EQ(error.message,
            (dir_ / "normal.exr").string() + ": full, " + (dir_ / "normal.exr").string());
}

TEST_F(OutputFolderTest, FailedCommitNamesTheFileAndPutsOldFilesBack) {
  testing::WriteText(dir_ / "a.exr", "old a");
  testing::WriteText(dir_ / "b/notes.txt", "mine");
  {
    OutputFolder folder = OutputFolder::Open(dir_).value();
    ASSERT_TRUE(folder.WriteText("a.exr", "new a"));
    ASSERT_TRUE(folder.WriteText("b", "new b"));  // where a folder stands
    const Status committed = folder.Commit();
    ASSERT_FALSE(committed);
    EXPECT_EQ(committed.error().code, ErrorCode::kIo);
    EXPECT_EQ(committed.error().message,
              (dir_ / "b").string() + ": is a folder where a file must go; move it away");
  }
  EXPECT_THAT(Listing(dir_), ElementsAre("a.exr", "b", "b/notes.txt"));
  EXPECT_EQ(Text(dir_ / "a.exr"), "old a");
}

TEST_F(OutputFolderTest, CommitThatFailsMidwayTakesBackItsMoves) {
  testing::WriteText(dir_ / "a.exr", "old a");
  testing::WriteText(dir_ / "locked/b.exr", "old b");
  fs::permissions(temp_.Path(), fs::perms::all);
  fs::permissions(dir_, fs::perms::all);
  fs::permissions(dir_ / "locked", kReadOnly);
  {
    const AsNobody nobody;
    OutputFolder folder = OutputFolder::Open(dir_).value();
    ASSERT_TRUE(folder.WriteText("locked/b.exr", "new b"));
    ASSERT_TRUE(folder.WriteText("a.exr", "new a"));  // the record, moved aside first
    const Status committed = folder.Commit();
    ASSERT_FALSE(committed);
    EXPECT_THAT(committed.error().message, HasSubstr("locked/b.exr: cannot put in place: "));
  }
  fs::permissions(dir_ / "locked", fs::perms::owner_all);
  EXPECT_THAT(Listing(dir_), ElementsAre("a.exr", "locked", "locked/b.exr"));
  EXPECT_EQ(Text(dir_ / "a.exr"), "old a");
  EXPECT_EQ(Text(dir_ / "locked/b.exr"), "old b");
}

TEST_F(OutputFolderTest, CommitFailsForAFileThatWasNeverWritten) {
  {
    OutputFolder folder = OutputFolder::Open(dir_).value();
    ASSERT_TRUE(folder.WriteText("a.exr", "a"));
    (void)folder.Stage("b.exr");
    const Status committed = folder.Commit();
    ASSERT_FALSE(committed);
    EXPECT_THAT(committed.error().message, HasSubstr((dir_ / "b.exr").string()));
  }
  EXPECT_THAT(Listing(temp_.Path()), IsEmpty());
}

TEST_F(OutputFolderTest, FolderThatSomeoneElseUsesIsKept) {
  {
    const OutputFolder folder = OutputFolder::Open(dir_).value();
    testing::WriteText(dir_ / "notes.txt", "mine");
  }
  EXPECT_THAT(Listing(dir_), ElementsAre("notes.txt"));
}

TEST_F(OutputFolderTest, OnlyTheOwnerOfTheFilesRemovesThem) {
  std::optional<OutputFolder> moved_to;
  {
    OutputFolder folder = OutputFolder::Open(dir_).value();
    ASSERT_TRUE(folder.WriteText("a.exr", "a"));
    moved_to.emplace(std::move(folder));
  }
  ASSERT_TRUE(moved_to->Commit());
  EXPECT_THAT(Listing(dir_), ElementsAre("a.exr"));
}

TEST_F(OutputFolderTest, PathsThatAreFilesAreRefused) {
  testing::WriteText(temp_.Path() / "file", "mine");
  for (const fs::path& path : {temp_.Path() / "file", temp_.Path() / "file" / "maps"}) {
    const Result<OutputFolder> folder = OutputFolder::Open(path);
    ASSERT_FALSE(folder);
    EXPECT_EQ(folder.error().code, ErrorCode::kIo);
    EXPECT_THAT(folder.error().message, HasSubstr("exists and is not a folder"));
  }
  EXPECT_EQ(OutputFolder::Open("").error().code, ErrorCode::kIo);
}

TEST_F(OutputFolderTest, FoldersWithoutWritePermissionAreRefused) {
  fs::create_directories(dir_);
  fs::permissions(temp_.Path(), fs::perms::all);
  fs::permissions(dir_, kReadOnly);
  {
    const AsNobody nobody;
    const Result<OutputFolder> existing = OutputFolder::Open(dir_);
    ASSERT_FALSE(existing);
    EXPECT_EQ(existing.error().code, ErrorCode::kIo);
    EXPECT_EQ(existing.error().message,
              dir_.string() +
                  ": cannot write to this folder: Permission denied; get write "
                  "permission or choose another folder");
    EXPECT_THAT(OutputFolder::Open(dir_ / "new").error().message,
                HasSubstr("new: cannot create or enter this folder: Permission denied"));
    EXPECT_THAT(WriteFileWhole(dir_ / "rig.json", "new").error().message,
                HasSubstr("cannot write to this folder: Permission denied"));
  }
  fs::permissions(dir_, fs::perms::owner_all);
  EXPECT_THAT(Listing(dir_), IsEmpty());
}

TEST_F(OutputFolderTest, FullDiskFailsTheWriteAndKeepsOldFiles) {
  testing::WriteText(dir_ / "solve.json", "old");
  {
    const testing::FullDisk full(100);
    OutputFolder folder = OutputFolder::Open(dir_).value();
    const Status written = folder.WriteText("solve.json", std::string(1000, 'x'));
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().code, ErrorCode::kIo);
    EXPECT_EQ(written.error().message,
              (dir_ / "solve.json").string() + ": cannot write: File too large");
  }
  EXPECT_THAT(Listing(dir_), ElementsAre("solve.json"));
  EXPECT_EQ(Text(dir_ / "solve.json"), "old");
}

// Replaces a.exr, b/b.exr and solve.json, adds new.exr and takes away old.exr.
Status SecondRun(const fs::path& dir) {
  return OutputFolder::Open(dir).and_then([](OutputFolder folder) {
    Status status;
    for (const char* name : {"a.exr", "b/b.exr", "new.exr", "solve.json"}) {
      status =
          status.and_then([&] { return folder.WriteText(name, std::string("second ") + name); });
    }
    folder.Retire("old.exr");
    return status.and_then([&] { return folder.Commit(); });
  });
}

class KilledInCommitTest : public OutputFolderTest {
 protected:
  void FirstRun() {
    OutputFolder folder = OutputFolder::Open(dir_).value();
    for (const char* name : {"a.exr", "b/b.exr", "old.exr", "solve.json"}) {
      ASSERT_TRUE(folder.WriteText(name, std::string("first ") + name));
    }
    ASSERT_TRUE(folder.Commit());
    testing::WriteText(dir_ / "notes.txt", "mine");
  }
  // Returns true if the second run was killed at that rename.
  bool KillSecondRunAt(int rename) const {
    const pid_t child = fork();
    if (child == 0) {
      renames_left = rename;
      _exit(SecondRun(dir_) ? 0 : 1);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_THAT(WEXITSTATUS(status), ::testing::AnyOf(0, 77));
    return WEXITSTATUS(status) == 77;
  }
  // What Open() and leaving without Commit() says and leaves.
  std::vector<std::string> NextRun() const {
    std::vector<std::string> notices;
    const NoticesTo here([&](const std::string& text) { notices.push_back(text); });
    (void)OutputFolder::Open(dir_).value();
    return notices;
  }
};

TEST_F(KilledInCommitTest, NextRunPutsFormerFilesBackFromEveryMove) {
  FirstRun();
  const auto first = testing::Tree(dir_);
  int kills = 0;
  for (; KillSecondRunAt(kills); ++kills) {
    const std::vector<std::string> notices = NextRun();

    EXPECT_EQ(testing::Tree(dir_), first) << "after a kill at move " << kills;
    if (kills > 0) {
      ASSERT_THAT(notices, ::testing::SizeIs(1)) << kills;
      EXPECT_THAT(notices[0],
                  HasSubstr(dir_.string() + ": an earlier run was cut short while it put "
                                            "its files in place; the "));
    }
  }
  EXPECT_EQ(kills, 8);  // four files aside, four in their places
  EXPECT_THAT(Listing(dir_),
              ElementsAre("a.exr", "b", "b/b.exr", "new.exr", "notes.txt", "solve.json"));
  EXPECT_EQ(Text(dir_ / "a.exr"), "second a.exr");
}

TEST_F(KilledInCommitTest, PuttingBackThatIsKilledTooIsGoneOnWith) {
  FirstRun();
  const auto first = testing::Tree(dir_);
  bool killed = true;
  for (int rename = 0; killed; ++rename) {
    ASSERT_TRUE(KillSecondRunAt(7));  // all but the record are in their places
    killed = KillSecondRunAt(rename);
    if (killed) {
      NextRun();
      EXPECT_EQ(testing::Tree(dir_), first) << "after a second kill at move " << rename;
    }
  }
}

TEST_F(KilledInCommitTest, WhatHasThePlaceByNowStaysAndTheFormerFileIsNamed) {
  FirstRun();
  ASSERT_TRUE(KillSecondRunAt(7));
  fs::remove(dir_ / "a.exr");
  testing::WriteText(dir_ / "a.exr", "by hand");

  const std::vector<std::string> notices = NextRun();

  EXPECT_EQ(Text(dir_ / "a.exr"), "by hand");
  EXPECT_EQ(Text(dir_ / "b/b.exr"), "first b/b.exr");
  EXPECT_FALSE(fs::exists(dir_ / "new.exr"));
  ASSERT_THAT(notices, ::testing::SizeIs(2));
  EXPECT_THAT(notices[0], HasSubstr("the 3 files from before it are back"));
  const fs::path kept = notices[1].substr(0, notices[1].find(": "));
  EXPECT_EQ(Text(kept), "first a.exr");
  EXPECT_THAT(NextRun(), ElementsAre(notices[1]));  // until someone has taken it
  fs::remove(kept);
  EXPECT_THAT(NextRun(), IsEmpty());
  EXPECT_THAT(Listing(dir_),
              ElementsAre("a.exr", "b", "b/b.exr", "notes.txt", "old.exr", "solve.json"));
}

// The disk fails at a move, or at the flush after the last one, and stays so until the next run.
TEST_F(KilledInCommitTest, NextRunPutsBackWhatADiskThatFailsDoesNot) {
  FirstRun();
  const auto first = testing::Tree(dir_);
  for (const int renames : {3, 6, 8}) {
    renames_that_work = renames;
    const Status second = SecondRun(dir_);
    renames_that_work = -1;
    ASSERT_FALSE(second);
    const std::string& said = second.error().message;
    const std::string words = "; the files that were there are kept in ";
    ASSERT_THAT(said, HasSubstr(words));
    const size_t begin = said.find(words) + words.size();
    const fs::path kept = said.substr(begin, said.find(", and the next run", begin) - begin);
    EXPECT_EQ(Text(kept / ".replaced/solve.json"), "first solve.json") << renames;

    EXPECT_THAT(NextRun(), ::testing::SizeIs(1)) << renames;

    EXPECT_EQ(testing::Tree(dir_), first) << renames;
  }
}

// Commit() refuses links, but one may come between.
TEST_F(KilledInCommitTest, ALinkThatWasMovedAsideIsPutBackAndNotWhatItLeadsTo) {
  testing::WriteText(temp_.Path() / "far/notes", "mine");
  fs::create_directories(dir_);
  fs::create_symlink(temp_.Path() / "far/notes", dir_ / "old.exr");
  const auto before = testing::Tree(temp_.Path());
  const OwnFolder staging = OwnFolder::Make(dir_, kStagingPrefix).value();
  testing::WriteText(staging.Path() / "solve.json", "new");
  const FileExchange exchange = {staging.Path(), dir_, {"solve.json"}, {"old.exr"}};
  const pid_t child = fork();
  if (child == 0) {
    bool keeps_former = false;
    renames_left = 1;  // the link is aside
    _exit(exchange.Run({dir_}, keeps_former) ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_EQ(WEXITSTATUS(status), 77);
  ASSERT_FALSE(fs::is_symlink(dir_ / "old.exr"));

  const ExchangeUndone undone = UndoExchange(staging.Path(), dir_);

  EXPECT_EQ(undone.back, 1U);
  EXPECT_THAT(undone.kept, IsEmpty());
  EXPECT_EQ(fs::read_symlink(dir_ / "old.exr"), temp_.Path() / "far/notes");
  EXPECT_EQ(Text(temp_.Path() / "far/notes"), "mine");
  fs::remove_all(staging.Path());
  EXPECT_EQ(testing::Tree(temp_.Path()), before);
}

TEST_F(OutputFolderTest, WhatIsRetiredMustBeAFile) {
  testing::WriteText(temp_.Path() / "far", "mine");
  testing::WriteText(dir_ / "folder.exr/notes", "mine");
  fs::create_symlink(temp_.Path() / "far", dir_ / "link.exr");
  const auto before = testing::Tree(temp_.Path());
  for (const auto& [name, words] :
       {std::pair("link.exr", "link.exr: is a link where a file must go; move it away"),
        std::pair("folder.exr", "folder.exr: is a folder where a file must go; move it away")}) {
    {
      OutputFolder folder = OutputFolder::Open(dir_).value();
      ASSERT_TRUE(folder.WriteText("a.exr", "a"));
      folder.Retire(name);
      const Status committed = folder.Commit();
      ASSERT_FALSE(committed);
      EXPECT_EQ(committed.error().code, ErrorCode::kIo);
      EXPECT_EQ(committed.error().message, (dir_ / words).string());
    }
    EXPECT_EQ(testing::Tree(temp_.Path()), before);
  }
}

TEST_F(OutputFolderTest, LinksAndDevicesInTheWayAreRefusedAndLeft) {
  const fs::path far = temp_.Path() / "far";
  testing::WriteText(far / "normal.exr", "mine");
  fs::create_directories(dir_);
  fs::create_symlink(far / "normal.exr", dir_ / "normal.exr");
  fs::create_directory_symlink(far, dir_ / "truth");
  ASSERT_EQ(mkfifo((dir_ / "pipe").c_str(), 0600), 0);
  const auto before = testing::Tree(temp_.Path());
  for (const auto& [name, words] :
       {std::pair("normal.exr", "normal.exr: is a link where a file must go; move it away"),
        std::pair("truth/normal.exr", "truth: is a link where a folder must go; move it away"),
        std::pair("pipe", "pipe: is a device or a pipe where a file must go; move it away")}) {
    {
      OutputFolder folder = OutputFolder::Open(dir_).value();
      ASSERT_TRUE(folder.WriteText("a.exr", "a"));
      ASSERT_TRUE(folder.WriteText(name, "new"));
      const Status committed = folder.Commit();
      ASSERT_FALSE(committed);
      EXPECT_EQ(committed.error().code, ErrorCode::kIo);
      EXPECT_EQ(committed.error().message, (dir_ / words).string());
    }
    EXPECT_EQ(testing::Tree(temp_.Path()), before);
  }
}

using WriteFileWholeTest = OutputFolderTest;

TEST_F(WriteFileWholeTest, DevicesAndPipesAreRefused) {
  ASSERT_EQ(mkfifo((temp_.Path() / "pipe").c_str(), 0600), 0);
  fs::create_symlink("pipe", temp_.Path() / "link.json");
  for (const char* name : {"pipe", "link.json"}) {
    const Status written = WriteFileWhole(temp_.Path() / name, "x");
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().code, ErrorCode::kIo);
    EXPECT_EQ(written.error().message,
              (temp_.Path() / name).string() + ": is a device or a pipe; give the name of a file");
  }
  EXPECT_THAT(Listing(temp_.Path()), ElementsAre("link.json", "pipe"));
}

TEST_F(WriteFileWholeTest, CreatesAndReplaces) {
  const fs::path path = temp_.Path() / "rig.json";
  ASSERT_TRUE(WriteFileWhole(path, "first"));
  EXPECT_EQ(Text(path), "first");
  ASSERT_TRUE(WriteFileWhole(path, "second"));
  EXPECT_EQ(Text(path), "second");
  EXPECT_THAT(Listing(temp_.Path()), ElementsAre("rig.json"));
}

TEST_F(WriteFileWholeTest, KeepsPermissionsAndSymbolicLinks) {
  const fs::path path = temp_.Path() / "rig.json";
  testing::WriteText(path, "old");
  fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink("rig.json", temp_.Path() / "link.json");

  ASSERT_TRUE(WriteFileWhole(temp_.Path() / "link.json", "new"));

  EXPECT_TRUE(fs::is_symlink(temp_.Path() / "link.json"));
  EXPECT_EQ(Text(path), "new");
  EXPECT_EQ(fs::status(path).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(WriteFileWholeTest, FullDiskKeepsTheOldFile) {
  const fs::path path = temp_.Path() / "rig.json";
  testing::WriteText(path, "old");
  {
    const testing::FullDisk full(100);
    const Status written = WriteFileWhole(path, std::string(1000, 'x'));
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().code, ErrorCode::kIo);
    EXPECT_EQ(written.error().message, path.string() + ": cannot write: File too large");
  }
  EXPECT_THAT(Listing(temp_.Path()), ElementsAre("rig.json"));
  EXPECT_EQ(Text(path), "old");
}

TEST_F(WriteFileWholeTest, NeedsAFolderThatExistsAndTheNameOfAFile) {
  EXPECT_THAT(WriteFileWhole(dir_ / "rig.json", "x").error().message,
              HasSubstr("No such file or directory; create the folder first"));
  EXPECT_THAT(WriteFileWhole(temp_.Path(), "x").error().message, HasSubstr("is a folder"));
}

}  // namespace
}  // namespace sateen::output_folder_test
