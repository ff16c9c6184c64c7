#include "pipelines/calibrate/rig_record.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "tests/testing/files.h"
#include "tests/testing/tree.h"

namespace sateen::rig_record_test {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class ReplaceFileTest : public ::testing::Test {
 protected:
  [[nodiscard]] fs::path Path(const char* name) const { return temp_.Path() / name; }
  const testing::TempFolder temp_;
};

TEST_F(ReplaceFileTest, KeepsEachFormerContentUnderANameOfItsOwn) {
  EXPECT_THAT(ReplaceFile(Path("rig.json"), "first")->string(), IsEmpty());
  const fs::path first = ReplaceFile(Path("rig.json"), "second").value();
  const fs::path second = ReplaceFile(Path("rig.json"), "third").value();
  EXPECT_EQ(testing::ReadText(first), "first");
  EXPECT_EQ(testing::ReadText(second), "second");
  EXPECT_EQ(testing::ReadText(Path("rig.json")), "third");
  EXPECT_THAT(testing::Listing(temp_.Path()), SizeIs(3));
}

TEST_F(ReplaceFileTest, FollowsALinkAndKeepsTheCopyBesideIt) {
  testing::WriteText(Path("far/shared.json"), "former");
  fs::create_symlink("far/shared.json", Path("rig.json"));

  const fs::path former = ReplaceFile(Path("rig.json"), "new").value();

  EXPECT_EQ(fs::read_symlink(Path("rig.json")), "far/shared.json");
  EXPECT_EQ(testing::ReadText(Path("far/shared.json")), "new");
  EXPECT_EQ(former.parent_path(), temp_.Path());
  EXPECT_EQ(testing::ReadText(former), "former");
  EXPECT_THAT(testing::Listing(Path("far")), SizeIs(1));
}

}  // namespace
}  // namespace sateen::rig_record_test
