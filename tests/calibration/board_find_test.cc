#include "calibration/print/board_find.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rig/projection.h"
#include "tests/calibration/synthetic_boards.h"
#include "tests/calibration/test_pictures.h"

namespace sateen::board_find_test {
namespace {

using namespace sateen::testing;
using ::testing::HasSubstr;

BoardSpec Spec(const char* text) { return ParseBoardSpec(text).value(); }

Camera SmallLens() {
  Camera camera = OverheadCamera({800, 600}, 500.0, 320.0);
  camera.distortion = {-0.12, 0.05, 0.001, -0.001, 0.0};
  return camera;
}

Image<uint8_t> Picture(const BoardSpec& spec, double turn_deg, double tilt_deg,
                       const Eigen::Vector3d& center_mm = {0, 0, 520}) {
  return PictureOf(SmallLens(), CameraFromBoard(turn_deg, tilt_deg, 30.0, center_mm), WhiteOf(spec),
                   5);
}

// Root mean square distance of the corners found from where they are.
double ErrorPx(const BoardView& view, double turn_deg, double tilt_deg,
               const Eigen::Vector3d& center_mm = {0, 0, 520}) {
  Camera camera = SmallLens();
  camera.table_from_camera.setIdentity();
  double sum = 0.0;
  for (size_t i = 0; i < view.ids.size(); ++i) {
    const Eigen::Vector3d point =
        CameraFromBoard(turn_deg, tilt_deg, 30.0, center_mm) * view.points_mm[i];
    sum += (PixelOfTablePoint(camera, point) - view.corners_px[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(view.ids.size()));
}

TEST(ParseBoardSpec, ReadsWhatTextWrites) {
  for (const char* text : {"chessboard:9x6:24mm", "charuco:10x7:25mm:18mm:DICT_4X4_50",
                           "charuco:10x7:25.5mm:18mm:DICT_5X5_250:legacy"}) {
    EXPECT_EQ(Spec(text).Text(), text);
  }
  EXPECT_EQ(Spec("chessboard:9x6:24mm").columns, 10);
  EXPECT_EQ(Spec("charuco:20x20:4mm:3mm:legacy").dictionary, "DICT_4X4_250");
  EXPECT_TRUE(Spec("charuco:20x20:4mm:3mm:legacy").legacy);
}

TEST(ParseBoardSpec, NamesTheFormExpected) {
  for (const char* text :
       {"", "chess", "chessboard:9x6", "chessboard:9:24mm", "chessboard:9x6:24",
        "charuco:10x7:25mm", "charuco:10x7:25mm:18mm:old", "chessboard:9x6:24mm:1",
        "chessboard:9x999999999999:24mm", "circles:9x6:24mm"}) {
    EXPECT_THAT(ParseBoardSpec(text).error().message, HasSubstr("need \"chessboard:9x6:24mm\""))
        << text;
  }
  EXPECT_THAT(ParseBoardSpec("chessboard:1x6:24mm").error().message, HasSubstr("need 3 to 100"));
  EXPECT_THAT(ParseBoardSpec("chessboard:2147483647x6:24mm").error().message,
              HasSubstr("3 to 100"));
  EXPECT_THAT(ParseBoardSpec("chessboard:9x6:-1mm").error().message, HasSubstr("a length > 0"));
  EXPECT_THAT(ParseBoardSpec("chessboard:9x6:nanmm").error().message, HasSubstr("a length > 0"));
  EXPECT_THAT(ParseBoardSpec("charuco:9x6:24mm:24mm").error().message,
              HasSubstr("marker < square"));
  EXPECT_THAT(ParseBoardSpec("charuco:9x6:24mm:18mm:DICT_9").error().message,
              HasSubstr("no dictionary 'DICT_9'"));
  EXPECT_THAT(ParseBoardSpec("charuco:20x20:4mm:3mm:DICT_4X4_50").error().message,
              HasSubstr("200 markers, and DICT_4X4_50 has 50"));
}

TEST(FindBoard, CornersOfBoardsLaidAnyWay) {
  for (const char* text :
       {"chessboard:9x6:20mm", "charuco:10x7:20mm:15mm", "charuco:9x8:20mm:15mm:legacy"}) {
    for (const double turn_deg : {0.0, 90.0, 200.0}) {
      const Result<BoardView> view = FindBoard(Picture(Spec(text), turn_deg, 20.0), Spec(text));
      ASSERT_TRUE(view) << text << ' ' << turn_deg << ": " << view.error().message;
      EXPECT_GT(view->ids.size(), 0.9 * Spec(text).CornerCount()) << text;
      EXPECT_LT(ErrorPx(*view, turn_deg, 20.0), 0.05) << text << ' ' << turn_deg;
      fmt::print("{} turned by {:g} degrees: corners off by {:.3f} px, edges {:.2f} px wide\n",
                 text, turn_deg, ErrorPx(*view, turn_deg, 20.0), view->edge_px);
    }
  }
}

TEST(FindBoard, CutByTheEdge) {
  const Eigen::Vector3d aside(110, 0, 520);
  const BoardSpec charuco = Spec("charuco:10x7:20mm:15mm");
  const Result<BoardView> part = FindBoard(Picture(charuco, 0.0, 20.0, aside), charuco);
  ASSERT_TRUE(part) << part.error().message;
  EXPECT_LT(part->ids.size(), 54U);
  EXPECT_LT(ErrorPx(*part, 0.0, 20.0, aside), 0.1);
  const BoardSpec chess = Spec("chessboard:9x6:20mm");
  EXPECT_THAT(FindBoard(Picture(chess, 0.0, 20.0, aside), chess).error().message,
              HasSubstr("no chessboard of 9 x 6 inner corners found; show the whole board"));
}

TEST(FindBoard, AnotherBoardIsNotBelieved) {
  const Image<uint8_t> chess = Picture(Spec("chessboard:9x6:20mm"), 10.0, 15.0);
  for (const char* text : {"chessboard:8x6:20mm", "chessboard:9x5:20mm", "chessboard:9x7:20mm",
                           "charuco:10x7:20mm:15mm"}) {
    const Result<BoardView> view = FindBoard(chess, Spec(text));
    ASSERT_FALSE(view) << text;
    EXPECT_EQ(view.error().code, ErrorCode::kDegenerate);
  }
  const Image<uint8_t> charuco = Picture(Spec("charuco:10x8:20mm:15mm"), 10.0, 15.0);
  for (const char* text :
       {"charuco:8x10:20mm:15mm", "charuco:10x8:20mm:15mm:legacy", "charuco:9x8:20mm:15mm"}) {
    const Result<BoardView> view = FindBoard(charuco, Spec(text));
    ASSERT_FALSE(view) << text;
    EXPECT_THAT(view.error().message, HasSubstr("another board")) << text;
  }
}

TEST(FindBoard, BlankPictures) {
  for (const uint8_t level : std::array<uint8_t, 3>{0, 128, 255}) {
    const Image<uint8_t> blank(640, 480, level);
    EXPECT_EQ(FindBoard(blank, Spec("chessboard:9x6:20mm")).error().code, ErrorCode::kDegenerate);
    EXPECT_THAT(FindBoard(blank, Spec("charuco:10x7:20mm:15mm")).error().message,
                HasSubstr("0 markers of DICT_4X4_50 found; need 3"));
  }
}

}  // namespace
}  // namespace sateen::board_find_test
