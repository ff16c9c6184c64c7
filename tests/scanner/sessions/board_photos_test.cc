#include "scanner/sessions/board_photos.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "imaging/image_io.h"
#include "tests/testing/files.h"

namespace sateen::board_photos_test {
namespace {

using namespace sateen::testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> NamesOf(const std::vector<BoardPhoto>& photos) {
  std::vector<std::string> names;
  for (const BoardPhoto& photo : photos) {
    names.push_back(photo.name);
  }
  return names;
}

constexpr const char* kSession = R"({"schema": "sateen.session/1", "kind": "board",
  "rig": "none.json", "frames": [{"role": "lit", "light": "a", "file": "a.exr"},
  {"role": "lit", "light": "b", "file": "b.exr"}, {"role": "dark", "file": "dark.exr"}]})";

TEST(ListBoardPhotos, TakesPhotographsAndSessionsInNaturalOrder) {
  TempFolder folder;
  for (const char* name : {"p10.jpg", "p2.PNG", "p3.dng", "notes.txt", ".hidden.png"}) {
    WriteText(folder.Path() / name, "");
  }
  WriteText(folder.Path() / "p9" / "session.json", kSession);
  WriteText(folder.Path() / "other" / "file.png", "");
  WriteText(folder.Path() / "sheet" / "session.json",
            R"({"schema": "sateen.session/1", "kind": "sheet", "rig": "r.json",
                "frames": [{"role": "lit", "light": "a", "file": "a.exr"}]})");
  const BoardFolder found = ListBoardPhotos(folder.Path()).value();
  EXPECT_THAT(NamesOf(found.photos), ElementsAre("p2.PNG", "p3.dng", "p9", "p10.jpg"));
  EXPECT_THAT(found.ignored,
              ElementsAre("notes.txt: not a photograph", "other: a folder without session.json",
                          HasSubstr("is a session of kind 'sheet'; need a board")));
  EXPECT_EQ(found.photos[2].files.size(), 2U);  // without the dark frame
  EXPECT_EQ(found.sha256_of_input.size(), 1U);
  EXPECT_EQ(ListBoardPhotos(folder.Path() / "p9").value().photos.size(), 1U);
  EXPECT_EQ(ListBoardPhotos(folder.Path() / "p2.PNG").value().photos.size(), 1U);
  EXPECT_THAT(ListBoardPhotos(folder.Path() / "sheet").error().message, HasSubstr("need a board"));
  EXPECT_EQ(ListBoardPhotos(folder.Path() / "absent").error().code, ErrorCode::kIo);
}

TEST(ReadBoardPicture, EightBitsAreKeptAndLinearLightIsScaled) {
  TempFolder folder;
  Image<uint8_t> levels(4, 2, 7);
  levels.At(1, 0) = 200;
  ASSERT_TRUE(WritePng8(folder.Path() / "a.png", levels));
  const BoardPhoto png{"a.png", {FrameFile{folder.Path() / "a.png", 1.0, std::nullopt}}};
  EXPECT_EQ(ReadBoardPicture(png).value().grey.pixels, levels.pixels);

  // Two frames whose sum is 0 to 4: 4 is white, 1 is a quarter of it, which sRGB codes as 137.
  Image<float> a(40, 1, 3.0F);
  Image<float> b(40, 1, 1.0F);
  a.At(0, 0) = 0.5F;
  b.At(0, 0) = 0.5F;
  ASSERT_TRUE(WriteExr(folder.Path() / "a.exr", a));
  ASSERT_TRUE(WriteExr(folder.Path() / "b.exr", b));
  WriteText(folder.Path() / "session.json", kSession);
  const BoardFolder session = ListBoardPhotos(folder.Path()).value();
  const BoardPicture picture = ReadBoardPicture(session.photos[0]).value();
  EXPECT_EQ(picture.grey.At(0, 0), 137);
  EXPECT_EQ(picture.grey.At(1, 0), 255);
  EXPECT_EQ(picture.sha256_of_input.size(), 2U);

  ASSERT_TRUE(WriteExr(folder.Path() / "a.exr", Image<float>(40, 1, 0.0F)));
  ASSERT_TRUE(WriteExr(folder.Path() / "b.exr", Image<float>(40, 1, 0.0F)));
  EXPECT_THAT(ReadBoardPicture(session.photos[0]).error().message, HasSubstr("is black"));
}

}  // namespace
}  // namespace sateen::board_photos_test
