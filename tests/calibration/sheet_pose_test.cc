#include "calibration/sheet/sheet_pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>

#include "core/angle.h"
#include "simulation/random.h"
#include "simulation/render.h"
#include "simulation/rigs.h"
#include "simulation/sensor.h"

namespace sateen::sheet_pose_test {
namespace {

using ::testing::HasSubstr;

constexpr const char* kBorder = "sheet:200x150mm:10mm";

// A sheet that lies tilted, turned and shifted on the table.
struct Lie {
  double slope_deg = 0.0;
  double azimuth_deg = 0.0;
  double turn_deg = 0.0;
  Eigen::Vector3d shift_mm = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Isometry3d TableFromSheet() const {
    const double azimuth = azimuth_deg * kRadPerDeg;
    // Rises towards the azimuth: turned about the axis a quarter turn before it.
    const Eigen::Vector3d axis(std::sin(azimuth), -std::cos(azimuth), 0.0);
    return Eigen::Translation3d(shift_mm) * Eigen::AngleAxisd(slope_deg * kRadPerDeg, axis) *
           Eigen::AngleAxisd(turn_deg * kRadPerDeg, Eigen::Vector3d::UnitZ()) *
           Eigen::Isometry3d::Identity();
  }
};

Rig TestRig() {
  Rig rig = RingRig({640, 480}, LightModel::kNear, 200.0);
  rig.lights.resize(3);
  rig.camera->distortion = {-0.1, 0.05, 0.0005, -0.0003, 0.0};
  return rig;
}

// The frames of a session as the 14-bit mosaic of a D5100 has them.
std::vector<Image<float>> Frames(const Rig& rig, const Lie& lie) {
  Scene scene{.rig = rig};
  const Eigen::Isometry3d pose = lie.TableFromSheet();
  const Eigen::Vector3d n = pose.linear().col(2);
  scene.surface = MakePlane(lie.slope_deg * kRadPerDeg, lie.azimuth_deg * kRadPerDeg,
                            n.dot(pose.translation()) / n.z())
                      .value();
  scene.materials.resize(1);
  scene.materials[0].albedo = PrintAlbedo{
      .print = PrintNamed(kBorder).value(), .table_from_print = pose, .light = 0.99, .beyond = 0.1};
  scene.lens.samples = 4;
  Result<SceneRenderer> renderer = SceneRenderer::Create(scene);
  Sensor sensor = SensorNamed("nikon-d5100").value();
  sensor.black_dn = 600;
  sensor.full_scale = 1.5;
  std::vector<Image<float>> frames;
  for (size_t light = 0; light < rig.lights.size(); ++light) {
    const RenderedFrame frame = renderer->Render(light).value();
    const Image<uint16_t> mosaic = Expose(sensor, frame.radiance, HashOf(1, light)).value();
    Image<float>& grey = frames.emplace_back(mosaic.Size());
    for (size_t i = 0; i < grey.pixels.size(); ++i) {
      grey.pixels[i] = static_cast<float>(mosaic.pixels[i]) - 600.0F;
    }
  }
  return frames;
}

// Three poses of a sheet, rendered once.
class FitSheetPoseTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    lies_ = new std::vector<Lie>{{.turn_deg = 2.0, .shift_mm = {1.5, -1.0, 0.0}},
                                 {10.0, 0.0, -3.0, {2.0, 1.0, 15.0}},
                                 {10.0, 250.0, 178.0, {-2.0, 1.0, 12.0}}};
    frames_ = new std::vector<std::vector<Image<float>>>;
    for (const Lie& lie : *lies_) {
      frames_->push_back(Frames(TestRig(), lie));
    }
  }
  static void TearDownTestSuite() {
    delete lies_;
    delete frames_;
  }

  static Result<SheetPose> Fit(const std::vector<Image<float>>& frames,
                               const char* border = kBorder) {
    return FitSheetPose(frames, *TestRig().camera, ParseSheetBorder(border).value());
  }
  static std::string ErrorOf(const std::vector<Image<float>>& frames,
                             const char* border = kBorder) {
    const Result<SheetPose> pose = Fit(frames, border);
    return pose ? "none" : pose.error().message;
  }

  static std::vector<Lie>* lies_;
  static std::vector<std::vector<Image<float>>>* frames_;
};

std::vector<Lie>* FitSheetPoseTest::lies_ = nullptr;
std::vector<std::vector<Image<float>>>* FitSheetPoseTest::frames_ = nullptr;

// Returns w and d of SheetPose::covariance from the found pose to the truth.
Eigen::Matrix<double, 6, 1> StepFrom(const Eigen::Isometry3d& found,
                                     const Eigen::Isometry3d& truth) {
  const Eigen::AngleAxisd turn(truth.linear() * found.linear().transpose());
  Eigen::Matrix<double, 6, 1> step;
  step << turn.angle() * turn.axis(), truth.translation() - found.translation();
  return step;
}

void Paint(Image<float>& frame, int left, int top, int width, int height, float value) {
  for (int y = top; y < top + height; ++y) {
    for (int x = left; x < left + width; ++x) {
      frame.At(x, y) = value;
    }
  }
}

// Bounds: what 4 x 4 samples a pixel leave of an edge that is seen in a few thousand pixels; ten
// times less than what the lights' bars would bear.
TEST_F(FitSheetPoseTest, FindsWhereTheSheetLiesAndHowSurely) {
  double worst_sigmas = 0.0;
  for (size_t i = 0; i < lies_->size(); ++i) {
    const Result<SheetPose> pose = Fit((*frames_)[i]);
    ASSERT_TRUE(pose) << pose.error().message;
    const Eigen::Matrix<double, 6, 1> off =
        StepFrom(pose->table_from_sheet, (*lies_)[i].TableFromSheet());
    const double tilt_deg = off.head<2>().norm() * kDegPerRad;
    const double turn_deg = std::abs(off[2]) * kDegPerRad;
    fmt::print(
        "slope {:2.0f}: tilt off by {:.5f} +- {:.5f} deg, turn {:.5f} +- {:.5f} deg, shift "
        "{:.4f} +- {:.4f} mm; {} of {} markers, misfit {:.3f}, blur {:.2f} px\n",
        (*lies_)[i].slope_deg, tilt_deg, pose->rotation_sd_rad.head<2>().norm() * kDegPerRad,
        turn_deg, pose->rotation_sd_rad.z() * kDegPerRad, off.tail<3>().norm(),
        pose->position_sd_mm.norm(), pose->markers_used, pose->markers, pose->misfit,
        pose->blur_px);
    EXPECT_LT(tilt_deg, 0.01);
    EXPECT_LT(turn_deg, 0.002);
    EXPECT_LT(off.tail<3>().norm(), 0.02);
    EXPECT_NEAR(pose->blur_px, std::sqrt(1.0 / 12.0), 0.06);  // the pixel alone
    EXPECT_GE(pose->markers_used, 20U);
    const double sigmas = std::sqrt(off.dot(pose->covariance.ldlt().solve(off)) / 6.0);
    worst_sigmas = std::max(worst_sigmas, sigmas);
    EXPECT_GT(sigmas, 0.2) << "of the covariance: it is too wide";
  }
  EXPECT_LT(worst_sigmas, 3.0) << "of the covariance: it is too narrow";
}

TEST_F(FitSheetPoseTest, ACoveredMarkerIsLeftOutAndEnoughOfTheBorderDoes) {
  const SheetPose whole = Fit((*frames_)[1]).value();
  std::vector<Image<float>> frames = (*frames_)[1];
  for (Image<float>& frame : frames) {
    Paint(frame, 0, 0, 640, 130, 3000.0F);   // a strip of cloth over the top row
    Paint(frame, 330, 430, 50, 9, 9000.0F);  // and a scrap over the edge of a marker below
  }
  const Result<SheetPose> pose = Fit(frames);
  ASSERT_TRUE(pose) << pose.error().message;
  EXPECT_LT(pose->markers_used, whole.markers_used);
  EXPECT_GE(pose->markers_used, 8U);
  const Eigen::Matrix<double, 6, 1> off =
      StepFrom(pose->table_from_sheet, (*lies_)[1].TableFromSheet());
  EXPECT_LT(off.head<2>().norm() * kDegPerRad, 0.05);
}

TEST_F(FitSheetPoseTest, NamesWhatIsWrongWithTheBorder) {
  const std::vector<Image<float>>& flat = (*frames_)[0];
  std::vector<Image<float>> mixed = flat;
  mixed[1] = (*frames_)[1][1];
  EXPECT_THAT(ErrorOf(mixed), HasSubstr("frame 1"));
  EXPECT_THAT(ErrorOf(mixed), HasSubstr("two sheets mixed up"));
  EXPECT_THAT(ErrorOf(flat, "sheet:190x150mm:10mm"), HasSubstr("it is another sheet"));
  EXPECT_THAT(ErrorOf(flat, "sheet:200x150mm:10mm:DICT_6X6_50"),
              HasSubstr("0 markers of the border"));
  std::vector<Image<float>> mirrored = flat;
  for (Image<float>& frame : mirrored) {
    for (int y = 0; y < frame.height; ++y) {
      std::reverse(&frame.At(0, y), &frame.At(0, y) + frame.width);
    }
  }
  EXPECT_THAT(ErrorOf(mirrored), HasSubstr("markers of the border"));
  EXPECT_THAT(ErrorOf(std::vector<Image<float>>(2, Image<float>(640, 480, 1.0F))),
              HasSubstr("0 markers of the border"));
  std::vector<Image<float>> one_corner = flat;
  for (Image<float>& frame : one_corner) {
    Paint(frame, 0, 0, 640, 420, 5000.0F);
    Paint(frame, 0, 0, 420, 480, 5000.0F);
  }
  EXPECT_THAT(ErrorOf(one_corner), HasSubstr("two tilts"));
  EXPECT_THAT(ErrorOf({}), HasSubstr("no frames"));
  EXPECT_THAT(ErrorOf({Image<float>(64, 48)}), HasSubstr("need 640 x 480"));
}

// A picture of four times as many pixels is joined to the same, and the pose is the same.
TEST_F(FitSheetPoseTest, LargePicturesAreShrunk) {
  const SheetBorder border = ParseSheetBorder(kBorder).value();
  Camera large = *TestRig().camera;
  large.size_px = {2560, 1920};
  large.fx *= 4.0;
  large.fy *= 4.0;
  large.cx = (large.cx + 0.5) * 4.0 - 0.5;
  large.cy = (large.cy + 0.5) * 4.0 - 0.5;
  const int shrink = SheetShrink(large, border);
  EXPECT_EQ(shrink, 2);
  EXPECT_EQ(SheetShrink(*TestRig().camera, border), 1);
  std::vector<Image<float>> doubled;  // 640 x 480 as 1280 x 960
  for (const Image<float>& frame : (*frames_)[0]) {
    Image<float>& twice = doubled.emplace_back(1280, 960);
    for (int y = 0; y < twice.height; ++y) {
      for (int x = 0; x < twice.width; ++x) {
        twice.At(x, y) = frame.At(x / 2, y / 2);
      }
    }
  }
  const Result<SheetPose> pose = FitSheetPose(doubled, large, border);
  ASSERT_TRUE(pose) << pose.error().message;
  const SheetPose plain = Fit((*frames_)[0]).value();
  const Eigen::Matrix<double, 6, 1> off = StepFrom(pose->table_from_sheet, plain.table_from_sheet);
  EXPECT_LT(off.head<3>().norm() * kDegPerRad, 0.01);
  EXPECT_LT(off.tail<3>().norm(), 0.02);
}

}  // namespace
}  // namespace sateen::sheet_pose_test
