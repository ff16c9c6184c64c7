#include "core/files/own_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "tests/testing/files.h"
#include "tests/testing/tree.h"

namespace {

bool is_network_disk = false;  // which keeps the entry of a file until the file is closed

bool has_locks = true;  // a disk may have none

bool HasOpenFiles(const std::filesystem::path& folder) {
  for (const auto& descriptor : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code ignored;
    const std::filesystem::path file = std::filesystem::read_symlink(descriptor, ignored);
    if (file.parent_path() == folder) {
      return true;
    }
  }
  return false;
}

}  // namespace

// Replaced in this program alone.
extern "C" int rmdir(const char* path) {
  if (is_network_disk && HasOpenFiles(path)) {
    errno = ENOTEMPTY;
    return -1;
  }
  return static_cast<int>(syscall(SYS_rmdir, path));
}

extern "C" int flock(int file, int operation) {
  if (!has_locks) {
    errno = ENOLCK;
    return -1;
  }
  return static_cast<int>(syscall(SYS_flock, file, operation));
}

namespace sateen::own_folder_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;

namespace fs = std::filesystem;

constexpr const char* kPrefix = ".sateen-";

class OwnFolderTest : public ::testing::Test {
 protected:
  // Makes a folder with a file in a process that ends without removing it, as a killed one does.
  fs::path LeftByKilledProcess() const {
    const pid_t child = fork();
    if (child == 0) {
      const OwnFolder folder = OwnFolder::Make(temp_.Path(), kPrefix).value();
      testing::WriteText(folder.Path() / "deep/file", folder.Path().string());
      testing::WriteText(temp_.Path() / "name", folder.Path().string());
      _exit(0);
    }
    waitpid(child, nullptr, 0);
    const fs::path left = testing::ReadText(temp_.Path() / "name");
    fs::remove(temp_.Path() / "name");
    return left;
  }
  [[nodiscard]] std::vector<OwnFolder> Abandoned() const {
    return OwnFolder::Abandoned(temp_.Path(), kPrefix);
  }
  // Returns what it says of folders that may be abandoned, and finds none that is.
  [[nodiscard]] std::vector<std::string> Doubts() const {
    std::vector<std::string> doubts;
    EXPECT_THAT(OwnFolder::Abandoned(temp_.Path(), kPrefix,
                                     [&](const std::string& text) { doubts.push_back(text); }),
                IsEmpty());
    return doubts;
  }

  const testing::TempFolder temp_;
};

TEST_F(OwnFolderTest, IsRemovedWithAllInItAndNothingElse) {
  testing::WriteText(temp_.Path() / "mine", "mine");
  {
    OwnFolder folder = OwnFolder::Make(temp_.Path(), kPrefix).value();
    const OwnFolder moved = std::move(folder);
    testing::WriteText(moved.Path() / "deep/file", "x");
    fs::create_symlink(temp_.Path(), moved.Path() / "link");
    EXPECT_THAT(moved.Path().filename().string(), ::testing::MatchesRegex("\\.sateen-......"));
  }
  EXPECT_THAT(testing::Listing(temp_.Path()), ElementsAre("mine"));
}

TEST_F(OwnFolderTest, IsRemovedFromANetworkDisk) {
  is_network_disk = true;
  {
    const OwnFolder folder = OwnFolder::Make(temp_.Path(), kPrefix).value();
    testing::WriteText(folder.Path() / "file", "x");
  }
  is_network_disk = false;
  EXPECT_THAT(testing::Listing(temp_.Path()), IsEmpty());
}

TEST_F(OwnFolderTest, KeptFolderStays) {
  fs::path path;
  {
    OwnFolder folder = OwnFolder::Make(temp_.Path(), kPrefix).value();
    path = folder.Path();
    folder.Keep();
  }
  EXPECT_TRUE(fs::is_directory(path));
}

TEST_F(OwnFolderTest, LeftByAKilledProcessGoesToTheNextRun) {
  const fs::path left = LeftByKilledProcess();
  ASSERT_TRUE(fs::exists(left / "deep/file"));
  {
    const std::vector<OwnFolder> abandoned = Abandoned();
    ASSERT_THAT(abandoned, SizeIs(1));
    EXPECT_EQ(abandoned[0].Path(), left);
    EXPECT_THAT(Abandoned(), IsEmpty()) << "two runs took it at once";
  }
  EXPECT_FALSE(fs::exists(left));
}

TEST_F(OwnFolderTest, OfALivingProcessIsNeverTouched) {
  const OwnFolder alive = OwnFolder::Make(temp_.Path(), kPrefix).value();
  testing::WriteText(alive.Path() / "file", "x");

  EXPECT_THAT(Doubts(), IsEmpty());

  EXPECT_TRUE(fs::exists(alive.Path() / "file"));
}

TEST_F(OwnFolderTest, KilledBeforeItsMarkIsRemovedIfEmpty) {
  std::string name = (temp_.Path() / ".sateen-XXXXXX").string();
  ASSERT_NE(mkdtemp(name.data()), nullptr);
  fs::create_directory(temp_.Path() / ".sateen-aaaaaa");  // as a disk of invented modes shows it
  fs::permissions(temp_.Path() / ".sateen-aaaaaa", static_cast<fs::perms>(0755));

  EXPECT_THAT(Abandoned(), IsEmpty());

  EXPECT_THAT(testing::Listing(temp_.Path()), IsEmpty());
}

TEST_F(OwnFolderTest, WhatOnlyLooksAlikeIsLeftAlone) {
  const fs::path own = LeftByKilledProcess();  // a real one, to link to from elsewhere
  const fs::path far = temp_.Path() / "far";
  fs::create_directory(far);
  fs::rename(own, far / own.filename());
  testing::WriteText(temp_.Path() / ".sateen-aaaaaa", "a file");
  testing::WriteText(temp_.Path() / ".sateen-bbbbbb/notes", "no mark");
  fs::permissions(temp_.Path() / ".sateen-bbbbbb", fs::perms::owner_all);
  fs::create_directory_symlink(far / own.filename(), temp_.Path() / ".sateen-cccccc");
  fs::create_directories(temp_.Path() / ".sateen-dddddd/.sateen-own");
  fs::create_directory(temp_.Path() / ".sateen-eeeeee");
  fs::create_symlink(far / own.filename() / ".sateen-own",
                     temp_.Path() / ".sateen-eeeeee/.sateen-own");
  testing::WriteText(temp_.Path() / ".sateen-ffffff/folder/notes", "no mark");
  testing::WriteText(temp_.Path() / ".sateen-incoming/.sateen-own", "");
  testing::WriteText(temp_.Path() / "sateen-gggggg/.sateen-own", "");
  testing::WriteText(temp_.Path() / ".sateen-hh_hhh/.sateen-own", "");
  ASSERT_EQ(mkfifo((temp_.Path() / ".sateen-iiiiii").c_str(), 0600), 0);
  fs::create_directory(temp_.Path() / ".sateen-jjjjjj");
  ASSERT_EQ(mkfifo((temp_.Path() / ".sateen-jjjjjj/.sateen-own").c_str(), 0600), 0);
  const std::vector<std::string> before = testing::Listing(temp_.Path());

  EXPECT_THAT(Doubts(), IsEmpty());

  EXPECT_EQ(testing::Listing(temp_.Path()), before);
}

TEST_F(OwnFolderTest, WithoutLocksAFolderOfFilesIsNamedOnceAndLeft) {
  const fs::path left = LeftByKilledProcess();
  has_locks = false;
  const OwnFolder without_files = OwnFolder::Make(temp_.Path(), kPrefix).value();

  const std::vector<std::string> doubts = Doubts();
  const std::vector<std::string> again = Doubts();

  has_locks = true;
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0], StartsWith(left.string() + ": a run left this folder or still works in"));
  EXPECT_THAT(doubts[0], HasSubstr("because this disk has no file locks; if none works here"));
  EXPECT_THAT(again, IsEmpty());
  EXPECT_TRUE(fs::exists(left / "deep/file"));
}

TEST_F(OwnFolderTest, OfAnotherUserIsNamedOnceAndLeft) {
  if (geteuid() != 0) {
    GTEST_SKIP() << "needs root, to give a folder away";
  }
  const fs::path left = LeftByKilledProcess();
  ASSERT_EQ(chown(left.c_str(), 65534, 65534), 0);
  const fs::path empty = temp_.Path() / ".sateen-aaaaaa";  // and without a mark
  ASSERT_TRUE(fs::create_directory(empty));
  ASSERT_EQ(chown(empty.c_str(), 65534, 65534), 0);

  const std::vector<std::string> doubts = Doubts();

  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0], StartsWith(left.string() + ": a run left this folder or still works in"));
  EXPECT_THAT(doubts[0], HasSubstr("because it belongs to another user; if none works here"));
  EXPECT_THAT(Doubts(), IsEmpty());
  EXPECT_TRUE(fs::exists(left / "deep/file"));
  EXPECT_TRUE(fs::exists(empty));
}

TEST_F(OwnFolderTest, ErrorNamesTheFolderAndTheReason) {
  const Result<OwnFolder> folder = OwnFolder::Make(temp_.Path() / "none", kPrefix);
  ASSERT_FALSE(folder);
  EXPECT_EQ(folder.error().code, ErrorCode::kIo);
  EXPECT_EQ(
      folder.error().message,
      (temp_.Path() / "none").string() +
          ": cannot write to this folder: No such file or directory; create the folder first");
}

TEST_F(OwnFolderTest, ScratchFoldersOfKilledProcessesGo) {
  const std::string former = getenv("TMPDIR") != nullptr ? getenv("TMPDIR") : "/tmp";
  setenv("TMPDIR", temp_.Path().c_str(), 1);
  testing::WriteText(temp_.Path() / "sateen-preview-1-0/notes", "a name that once was ours");
  const pid_t child = fork();
  if (child == 0) {
    const OwnFolder left = MakeScratchFolder("preview").value();
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  EXPECT_THAT(testing::Listing(temp_.Path()), SizeIs(4));  // the folder left, and its mark
  {
    const OwnFolder scratch = MakeScratchFolder("preview").value();
    EXPECT_THAT(testing::Listing(temp_.Path()), SizeIs(4));
  }
  setenv("TMPDIR", former.c_str(), 1);
  EXPECT_THAT(testing::Listing(temp_.Path()),
              ElementsAre("sateen-preview-1-0", "sateen-preview-1-0/notes"));
}

}  // namespace
}  // namespace sateen::own_folder_test
