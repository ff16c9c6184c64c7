#include "scanner/checks/gloss_shift.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sateen::gloss_shift_test {
namespace {

constexpr size_t kFrames = 11;  // ten lights, and the first again

// Ten lights in a ring, and the first again, less the first.
std::vector<Eigen::Vector2d> RingLights() {
  std::vector<Eigen::Vector2d> l;
  for (size_t k = 0; k < kFrames; ++k) {
    const double angle_rad = 0.2 * M_PI * static_cast<double>(k % (kFrames - 1));
    l.emplace_back(0.6 * std::cos(angle_rad) - 0.6, 0.6 * std::sin(angle_rad));
  }
  return l;
}

std::vector<Shift> Still(double sd_px) { return std::vector<Shift>(kFrames, {.sd_px = sd_px}); }

TEST(TakeOutGloss, TakesOutWhatWandersWithTheLight) {
  const std::vector<Eigen::Vector2d> l = RingLights();
  Eigen::Matrix2d b;
  b << 0.3, -0.1, 0.05, 0.2;
  std::vector<Shift> shifts = Still(0.01);
  for (size_t k = 0; k < kFrames; ++k) {
    shifts[k].px = b * l[k];
  }
  TakeOutGloss(l, shifts);
  for (const Shift& shift : shifts) {
    EXPECT_LT(shift.px.norm(), 1e-6);
    EXPECT_NEAR(shift.sd_px, 0.01, 1e-6);  // nothing is left of the jumps
  }
}

// Jumps below 0.005 px weigh alike, which leaves that much of the nudge to gloss.
TEST(TakeOutGloss, LeavesOneNudgeAlone) {
  std::vector<Shift> shifts = Still(0.01);
  for (size_t k = 5; k < kFrames; ++k) {
    shifts[k].px = {0.4, -0.2};
  }
  TakeOutGloss(RingLights(), shifts);
  for (size_t k = 0; k < kFrames; ++k) {
    const Eigen::Vector2d truth = k < 5 ? Eigen::Vector2d(0, 0) : Eigen::Vector2d(0.4, -0.2);
    EXPECT_LT((shifts[k].px - truth).norm(), 5e-3) << k;
    EXPECT_NEAR(shifts[k].sd_px, 0.01, 1e-3) << k;
  }
}

// Under lights that do not wander, jumps of one length each: it is added to every standard
// deviation but that of the last frame.
TEST(TakeOutGloss, AddsTheMedianOfTheJumpsThatAreLeft) {
  std::vector<Shift> shifts = Still(0.03);
  for (size_t k = 1; k < kFrames; k += 2) {
    shifts[k].px = {0.0, 0.04};
  }
  TakeOutGloss(std::vector<Eigen::Vector2d>(kFrames, Eigen::Vector2d::Zero()), shifts);
  EXPECT_EQ(shifts[0].sd_px, 0.03);
  for (size_t k = 1; k + 1 < kFrames; ++k) {
    EXPECT_NEAR(shifts[k].sd_px, 0.05, 1e-9) << k;
  }
  EXPECT_EQ(shifts[kFrames - 1].sd_px, 0.03);
}

}  // namespace
}  // namespace sateen::gloss_shift_test
