#include "calibration/lens/lens_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/angle.h"

namespace sateen::lens_check_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Fit of eight sharp views, tilted by 20 degrees each way, with corners all over the image.
LensFit GoodFit() {
  LensFit fit;
  fit.camera.size_px = {600, 400};
  fit.camera.fx = fit.camera.fy = 1000.0;
  fit.camera.distortion = {-0.1, 0.05, 0.001, 0.001, 0.02};
  fit.rms_px = 0.2;
  fit.held_out_rms_px = 0.25;
  fit.pinhole_sd = {1.0, 1.0, 1.0, 1.0};
  fit.distortion_sd = {0.01, 0.01, 1e-4, 1e-4, 0.01};
  fit.corner_sd_px = 0.3;
  for (int i = 0; i < 8; ++i) {
    const double tilt_rad = (i % 2 == 0 ? 20.0 : -20.0) * kRadPerDeg;
    fit.views.push_back({.name = fmt::format("v{}", i),
                         .corners = 50,
                         .edge_px = 1.0,
                         .normal_in_camera = {std::sin(tilt_rad), 0.0, std::cos(tilt_rad)}});
  }
  fit.coverage = Image<int>(6, 4, 10);
  return fit;
}

TEST(WarningsOf, NothingToSayOfGoodViews) {
  EXPECT_THAT(WarningsOf(GoodFit()), IsEmpty());
  EXPECT_NEAR(SpreadOfTiltsRad(GoodFit()), 40.0 * kRadPerDeg, 1e-12);
}

TEST(WarningsOf, FewViewsAndAlikeOnes) {
  LensFit fit = GoodFit();
  fit.views[3].left_out = "bent";
  EXPECT_THAT(WarningsOf(fit), ElementsAre("7 views; take 8 or more"));
  fit = GoodFit();
  for (LensViewReport& view : fit.views) {
    view.normal_in_camera.x() *= 0.5;
  }
  EXPECT_THAT(WarningsOf(fit), ElementsAre(HasSubstr("tilts differ by 21 degrees")));
}

TEST(WarningsOf, ABlurredViewAgainstTheOthers) {
  LensFit fit = GoodFit();
  fit.views[5].edge_px = 2.1;
  EXPECT_THAT(WarningsOf(fit), ElementsAre(HasSubstr("v5 is blurred: its edges are 2.1 px wide, "
                                                     "those of the median view 1.0 px")));
  fit.views[5].edge_px = 1.9;
  EXPECT_THAT(WarningsOf(fit), IsEmpty());
  for (LensViewReport& view : fit.views) {
    view.edge_px = 0.5;
  }
  fit.views[5].edge_px = 1.15;  // sharp, if more than twice as wide
  EXPECT_THAT(WarningsOf(fit), IsEmpty());
}

TEST(WarningsOf, EmptyCornersByName) {
  const std::array<std::pair<int, int>, 4> at = {{{0, 0}, {5, 0}, {0, 3}, {5, 3}}};
  const std::array names = {"top left", "top right", "bottom left", "bottom right"};
  for (size_t i = 0; i < 4; ++i) {
    LensFit fit = GoodFit();
    fit.coverage.At(at[i].first, at[i].second) = 0;
    EXPECT_THAT(WarningsOf(fit),
                ElementsAre(HasSubstr(fmt::format("no board corner in the {} of", names[i]))));
  }
}

TEST(WarningsOf, AnImageThatIsNotCovered) {
  LensFit fit = GoodFit();
  for (int x = 1; x < 5; ++x) {  // 8 of 24 cells, the corners not
    fit.coverage.At(x, 1) = fit.coverage.At(x, 2) = 0;
  }
  EXPECT_THAT(WarningsOf(fit), ElementsAre("board corners cover 67 % of the image; cover 70 %"));
  fit.coverage.At(1, 1) = 1;  // 17 of 24
  EXPECT_THAT(WarningsOf(fit), IsEmpty());
}

TEST(WarningsOf, FiguresThatAreNotKnownWell) {
  LensFit fit = GoodFit();
  fit.pinhole_sd[0] = 2.5;
  EXPECT_THAT(WarningsOf(fit), ElementsAre(HasSubstr("the focal length is known to 0.25 %")));
  fit = GoodFit();
  fit.held_out_rms_px = 0.31;
  EXPECT_THAT(WarningsOf(fit), ElementsAre(HasSubstr("views held out are off by 0.31 px")));
}

TEST(WarningsOf, DistortionThatTheCornersDoNotTell) {
  LensFit fit = GoodFit();
  fit.distortion_sd[4] = 0.5;  // alone says nothing
  EXPECT_THAT(WarningsOf(fit), IsEmpty());
  fit.corner_sd_px = 1.2;
  EXPECT_THAT(WarningsOf(fit),
              ElementsAre(HasSubstr("in the corners of the image is known to 1.2 px; not "
                                    "determined: k3 0.02 +- 0.5; take more views")));
  fit.distortion_sd[4] = 0.01;
  fit.corner_sd_px = std::numeric_limits<double>::infinity();
  EXPECT_THAT(WarningsOf(fit), ElementsAre(HasSubstr("is not known: by some of the views the lens "
                                                     "folds there; take more views")));
}

}  // namespace
}  // namespace sateen::lens_check_test
