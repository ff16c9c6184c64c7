#include "calibration/lens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calibration/pose.h"
#include "imaging/image_io.h"
#include "tests/calibration/synthetic_boards.h"
#include "tests/calibration/test_pictures.h"
#include "tests/testing/files.h"

namespace sateen {
namespace {

using namespace sateen::testing;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const BoardSpec& Charuco() {
  static const BoardSpec spec = ParseBoardSpec("charuco:14x10:20mm:15mm").value();
  return spec;
}

TEST(CalibrateLens, NoiselessViewsGiveTheLensBack) {
  const Camera truth = LensOf3000Px();
  const LensFit fit =
      CalibrateLens(TiltedViews(truth, Charuco(), 20, 0.0, 1), truth.size_px).value();

  EXPECT_LT(fit.rms_px, 1e-3);  // corners are floats in OpenCV
  EXPECT_NEAR(fit.camera.fx, truth.fx, 0.05);
  EXPECT_NEAR(fit.camera.fy, truth.fy, 0.05);
  EXPECT_NEAR(fit.camera.cx, truth.cx, 0.05);
  EXPECT_NEAR(fit.camera.cy, truth.cy, 0.05);
  EXPECT_NEAR(fit.camera.distortion[0], truth.distortion[0], 1e-3);
  EXPECT_NEAR(fit.camera.distortion[2], truth.distortion[2], 1e-5);
}

TEST(CalibrateLens, TwentyNoisyViewsGiveFocalLengthAndPrincipalPoint) {
  const Camera truth = LensOf3000Px();
  Eigen::Vector4d off = Eigen::Vector4d::Zero();
  constexpr int kRuns = 5;
  for (uint64_t run = 0; run < kRuns; ++run) {
    const LensFit fit =
        CalibrateLens(TiltedViews(truth, Charuco(), 20, 0.1, 100 * run), truth.size_px).value();
    EXPECT_NEAR(fit.camera.fx / truth.fx, 1.0, 5e-4);
    EXPECT_NEAR(fit.camera.fy / truth.fy, 1.0, 5e-4);
    EXPECT_NEAR(fit.camera.cx, truth.cx,
                1.6);  // 1.06 is its standard deviation: a lens of 28 degrees
    EXPECT_NEAR(fit.camera.cy, truth.cy, 1.6);
    EXPECT_NEAR(fit.rms_px, 0.1 * std::sqrt(2.0), 0.01);
    EXPECT_NEAR(fit.held_out_rms_px, 0.1 * std::sqrt(2.0), 0.01);
    EXPECT_THAT(fit.warnings, IsEmpty());
    const Eigen::Vector4d errors(fit.camera.fx - truth.fx, fit.camera.fy - truth.fy,
                                 fit.camera.cx - truth.cx, fit.camera.cy - truth.cy);
    off +=
        errors.cwiseQuotient(Eigen::Map<const Eigen::Vector4d>(fit.pinhole_sd.data())).cwiseAbs2() /
        kRuns;
    RecordProperty(fmt::format("run{}", run),
                   fmt::format("fx {:+.4f} % cx {:+.2f} cy {:+.2f} sd {:.2f} {:.2f}",
                               100 * (fit.camera.fx / truth.fx - 1), errors[2], errors[3],
                               fit.pinhole_sd[0], fit.pinhole_sd[2]));
  }
  EXPECT_NEAR(std::sqrt(off.mean()), 1.0, 0.4);  // the standard deviations are those of the errors
}

TEST(CalibrateLens, FourteenPhotosOfOpenCv) {
  SATEEN_NEEDS_DATA("lens/opencv-left");
  const BoardSpec spec = ParseBoardSpec("chessboard:9x6:25mm").value();
  std::vector<BoardView> views;
  for (int i = 1; i <= 14; ++i) {
    const Image<uint8_t> grey =
        GreyFile(DataDir() / fmt::format("lens/opencv-left/left{:02}.jpg", i));
    const Result<BoardView> view = FindBoard(grey, spec);
    ASSERT_TRUE(view) << i << ": " << view.error().message;
    EXPECT_EQ(view->ids.size(), 54U);
    views.push_back(*view);
  }
  const LensFit fit = CalibrateLens(views, views[0].size_px).value();
  EXPECT_LT(fit.rms_px, 0.2);  // published: 0.393 on 13 of them
  EXPECT_LT(fit.held_out_rms_px, 0.25);
  // Published: 535.9, from corners refined in 23 x 23 pixels, which reach over the neighbouring
  // corners; the same corners refined between their neighbours give 532.4 to 533.0.
  EXPECT_NEAR(fit.camera.fx, 532.9, 1.0);
  EXPECT_NEAR(fit.camera.fx / 535.9, 1.0, 0.007);
  EXPECT_NEAR(fit.camera.cx, 342.3, 1.5);
  EXPECT_NEAR(fit.camera.cy, 235.6, 1.5);
}

TEST(CalibrateLens, ABentViewIsLeftOutAndNamed) {
  const Camera truth = LensOf3000Px();
  std::vector<BoardView> views = TiltedViews(truth, Charuco(), 12, 0.1, 7);
  for (size_t i = 0; i < views[4].ids.size(); ++i) {
    views[4].corners_px[i].x() += 3e-3 * std::pow(views[4].points_mm[i].x(), 2) / 10.0;
  }
  views[4].name = "bent.jpg";
  const LensFit fit = CalibrateLens(views, truth.size_px).value();
  EXPECT_THAT(fit.views[4].left_out, HasSubstr("times the median"));
  EXPECT_EQ(fit.views[4].name, "bent.jpg");
  EXPECT_EQ(fit.views[4].held_out_px, 0.0);
  EXPECT_THAT(fit.views[3].left_out, IsEmpty());
  EXPECT_NEAR(fit.camera.fx / truth.fx, 1.0, 1e-3);
}

TEST(CalibrateLens, WarnsOfCornersWithoutABoardAndOfFewViews) {
  const Camera truth = LensOf3000Px();
  const BoardSpec small = ParseBoardSpec("charuco:8x6:12mm:9mm").value();
  std::vector<BoardView> views;
  for (int i = 0; i < 6; ++i) {
    views.push_back(SeenBoard(truth, small, CameraFromBoard(0, 12.0, 60.0 * i, {0, 0, 500}), 0.02,
                              static_cast<uint64_t>(i)));
  }
  const LensFit fit = CalibrateLens(views, truth.size_px).value();
  const std::string all = fmt::format("{}", fmt::join(fit.warnings, "\n"));
  EXPECT_THAT(all, HasSubstr("6 views; take 8 or more"));
  EXPECT_THAT(all, HasSubstr("top left, top right, bottom left, bottom right"));
  EXPECT_THAT(all, HasSubstr("the views are alike"));
  EXPECT_THAT(all, HasSubstr("% of the image"));
}

TEST(CalibrateLens, ErrorsSayWhatToDo) {
  const Camera truth = LensOf3000Px();
  std::vector<BoardView> views = TiltedViews(truth, Charuco(), 6, 0.1, 9);
  EXPECT_THAT(CalibrateLens(views, truth.size_px, {.outlier_ratio = 1.0}).error().message,
              HasSubstr("outlier_ratio = 1; need > 1"));
  EXPECT_THAT(CalibrateLens(views, {640, 480}).error().message, HasSubstr("need 640 x 480"));
  EXPECT_THAT(CalibrateLens({views[0], views[1]}, truth.size_px).error().message,
              HasSubstr("2 usable views of the board of 2; need 3"));
  std::vector<BoardView> flat;
  for (uint64_t i = 0; i < 6; ++i) {
    flat.push_back(SeenBoard(truth, Charuco(), CameraFromBoard(0, 0, 0, {0, 0, 600}), 0.1, i));
  }
  EXPECT_THAT(CalibrateLens(flat, truth.size_px).error().message, HasSubstr("too alike"));
}

}  // namespace
}  // namespace sateen
