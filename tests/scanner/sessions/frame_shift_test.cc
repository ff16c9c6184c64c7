#include "scanner/sessions/frames/frame_shift.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>

namespace sateen::frame_shift_test {
namespace {

constexpr ImageSize kPx = {40, 30};

LightFrame FrameOf(const std::function<double(double, double)>& value) {
  LightFrame frame{.rgb = Image3(kPx), .full_scale = 2.0F};
  for (Image<float>& plane : frame.rgb.planes) {
    for (int y = 0; y < kPx.height; ++y) {
      for (int x = 0; x < kPx.width; ++x) {
        plane.At(x, y) = static_cast<float>(value(x, y));
      }
    }
  }
  return frame;
}

double Texture(double x, double y) {
  return 0.5 + 0.2 * std::sin(0.9 * x) + 0.2 * std::cos(0.7 * y);
}

// A detail at x in the first frame is at x + shift in this one. Lanczos' window of six leaves 1 %.
TEST(LayOverFirst, BringsBackWhatHasMoved) {
  for (const Eigen::Vector2d& shift :
       {Eigen::Vector2d(0.4, 0.0), Eigen::Vector2d(-0.3, 0.7), Eigen::Vector2d(1.6, -2.5)}) {
    LightFrame frame =
        FrameOf([&](double x, double y) { return Texture(x - shift.x(), y - shift.y()); });
    LayOverFirst(shift, frame);
    for (int y = 6; y < kPx.height - 6; ++y) {
      for (int x = 6; x < kPx.width - 6; ++x) {
        ASSERT_NEAR(frame.rgb[1].At(x, y), Texture(x, y), 0.004) << x << ", " << y;
      }
    }
  }
}

TEST(LayOverFirst, KeepsEvenLightExactlyAndWholeShiftsSharp) {
  LightFrame even = FrameOf([](double, double) { return 0.7; });
  LayOverFirst({0.3, -0.2}, even);
  EXPECT_NEAR(even.rgb[0].At(20, 15), 0.7F, 1e-6F);
  LightFrame edge = FrameOf([](double x, double) { return x < 20.0 ? 0.0 : 1.0; });
  LayOverFirst({2.0, 0.0}, edge);
  EXPECT_NEAR(edge.rgb[0].At(17, 10), 0.0F, 1e-6F);
  EXPECT_NEAR(edge.rgb[0].At(18, 10), 1.0F, 1e-6F);
}

TEST(LayOverFirst, ASaturatedSampleSaturatesAllThatItHasAPartIn) {
  LightFrame frame = FrameOf([](double, double) { return 0.5; });
  frame.rgb[2].At(20, 15) = 7.0F;
  LayOverFirst({0.5, 0.0}, frame);
  for (int x = 17; x <= 22; ++x) {
    EXPECT_EQ(frame.rgb[2].At(x, 15), frame.full_scale) << x;
  }
  EXPECT_NEAR(frame.rgb[2].At(16, 15), 0.5F, 1e-6F);
  EXPECT_NEAR(frame.rgb[2].At(23, 15), 0.5F, 1e-6F);
  EXPECT_NEAR(frame.rgb[2].At(20, 14), 0.5F, 1e-6F);
  EXPECT_NEAR(frame.rgb[1].At(20, 15), 0.5F, 1e-6F);
}

TEST(LayOverFirst, AWholeShiftSaturatesOneSampleForOne) {
  LightFrame frame = FrameOf([](double, double) { return 0.5; });
  frame.rgb[1].At(20, 15) = 7.0F;
  LayOverFirst({1.0, 0.0}, frame);
  for (int x = 14; x <= 25; ++x) {
    EXPECT_EQ(frame.rgb[1].At(x, 15), x == 19 ? frame.full_scale : 0.5F) << x;
  }
}

TEST(LayOverFirst, OvershootIsNoSaturation) {
  LightFrame frame = FrameOf([](double x, double) { return x < 20.0 ? 0.0 : 1.99; });
  LayOverFirst({0.5, 0.0}, frame);
  for (const float value : frame.rgb[0].pixels) {
    EXPECT_LT(value, frame.full_scale);
  }
}

TEST(LayOverFirst, WhatWasNotSeenIsNoSample) {
  LightFrame frame = FrameOf(Texture);
  LayOverFirst({1.6, 0.0}, frame);
  EXPECT_TRUE(std::isnan(frame.rgb[0].At(39, 3)));
  EXPECT_FALSE(std::isnan(frame.rgb[0].At(37, 3)));
  EXPECT_FALSE(std::isnan(frame.rgb[0].At(0, 3)));
}

TEST(LayOverFirst, WithoutAShiftNothingChanges) {
  LightFrame frame = FrameOf(Texture);
  const std::vector<float> before = frame.rgb[0].pixels;
  LayOverFirst({0.0, 0.0}, frame);
  EXPECT_EQ(frame.rgb[0].pixels, before);
}

}  // namespace
}  // namespace sateen::frame_shift_test
