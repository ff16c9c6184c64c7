#include "scanner/sessions/files/folder_listing.h"

#include <algorithm>

#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::folder_listing_test {
namespace {

using ::testing::ElementsAre;
using testing::TempFolder;
using testing::WriteText;

TEST(NaturalLess, ComparesNumbersByValue) {
  std::vector<std::string> names = {"cat.10.tga", "cat.2.tga", "cat.2b.tga", "cat.1.tga",
                                    "Cat.9.tga",  "cat.tga",   "cat.02.tga"};
  std::sort(names.begin(), names.end(), NaturalLess);
  EXPECT_THAT(names, ElementsAre("Cat.9.tga", "cat.1.tga", "cat.02.tga", "cat.2.tga", "cat.2b.tga",
                                 "cat.10.tga", "cat.tga"));
}

TEST(NaturalLess, OrdersNumbersBeyondAnyInteger) {
  EXPECT_TRUE(NaturalLess("a99999999999999999999998", "a99999999999999999999999"));
  EXPECT_FALSE(NaturalLess("a99999999999999999999999", "a99999999999999999999998"));
}

TEST(NaturalLess, IsATotalOrderAlsoOfLeadingZeros) {
  EXPECT_TRUE(NaturalLess("a01", "a1"));
  EXPECT_FALSE(NaturalLess("a1", "a01"));
  EXPECT_FALSE(NaturalLess("a1", "a1"));
  EXPECT_TRUE(NaturalLess("a", "a0"));
}

TEST(FilesInNaturalOrder, LeavesOutHiddenFilesAndFolders) {
  const TempFolder temp;
  for (const char* name : {"10.png", "9.png", ".hidden.png", "folder.png/x"}) {
    WriteText(temp.Path() / name, "");
  }
  EXPECT_THAT(FilesInNaturalOrder(temp.Path()).value(), ElementsAre("9.png", "10.png"));
}

TEST(FilesInNaturalOrder, SaysWhyAFolderCannotBeListed) {
  const Result<std::vector<std::string>> names = FilesInNaturalOrder("/nonexistent/folder");
  ASSERT_FALSE(names);
  EXPECT_THAT(names.error(), testing::IsError(ErrorCode::kIo, "/nonexistent/folder"));
}

TEST(IsMaskName, KnowsTheNamesOfPublicDataSets) {
  for (const char* name : {"mask.png", "Mask.PNG", "cat.mask.tga", "cat_mask.png"}) {
    EXPECT_TRUE(IsMaskName(name)) << name;
  }
  for (const char* name : {"mask.txt", "cat.0.tga", "masked.png", "damask.png"}) {
    EXPECT_FALSE(IsMaskName(name)) << name;
  }
}

TEST(FindMask, RefusesToChooseBetweenTwo) {
  const TempFolder temp;
  WriteText(temp.Path() / "mask.png", "");
  EXPECT_EQ(FindMask(temp.Path()).value(), temp.Path() / "mask.png");
  WriteText(temp.Path() / "cat.mask.png", "");
  const auto mask = FindMask(temp.Path());
  ASSERT_FALSE(mask);
  EXPECT_THAT(mask.error(), testing::IsError(ErrorCode::kBadData, "cat.mask.png and mask.png"));
}

TEST(FindSharedMask, TakesOnlyWhatIsCalledMask) {
  const TempFolder temp;
  WriteText(temp.Path() / "cat.mask.png", "");
  EXPECT_EQ(FindSharedMask(temp.Path()), std::nullopt);
  WriteText(temp.Path() / "mask.png", "");
  EXPECT_EQ(FindSharedMask(temp.Path()), temp.Path() / "mask.png");
  EXPECT_EQ(FindSharedMask("/nonexistent/folder"), std::nullopt);
}

TEST(DescribeFolder, CountsFilesByTheirEnding) {
  const TempFolder temp;
  EXPECT_EQ(DescribeFolder(temp.Path()), "0 files");
  for (const char* name : {"a.png", "b.PNG", "c.txt", "README", "raw/d.nef"}) {
    WriteText(temp.Path() / name, "");
  }
  EXPECT_EQ(DescribeFolder(temp.Path()), "4 files (1 without extension, 2 .png, 1 .txt), 1 folder");
}

}  // namespace
}  // namespace sateen::folder_listing_test
