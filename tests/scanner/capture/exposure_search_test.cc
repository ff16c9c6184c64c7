#include "scanner/capture/exposure_search.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::exposure_search_test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using testing::IsError;

// Third stops from 1/4000 s to 30 s.
std::vector<double> CameraTimes() {
  std::vector<double> times;
  for (double time = 1.0 / 4000.0; time < 31.0; time *= std::cbrt(2.0)) {
    times.push_back(time);
  }
  return times;
}

struct Outcome {
  std::vector<double> exposures_s;
  int tests = 0;
};

// A linear scene: `rate` of what saturates per second at its bright end, `dark` of that at its dark
// end.
Result<Outcome> Search(double rate, double dark, const ExposureGoal& goal = {}) {
  Result<ExposureSearch> search = ExposureSearch::Begin(CameraTimes(), goal);
  if (!search) {
    return tl::unexpected(search.error());
  }
  Outcome outcome;
  while (!search->Found()) {
    ++outcome.tests;
    const double t = search->TestTime();
    const Status taken = search->Take({.peak = std::min(1.0, rate * t), .low = rate * dark * t});
    if (!taken) {
      return tl::unexpected(taken.error());
    }
  }
  outcome.exposures_s = search->Exposures();
  return outcome;
}

// Over five decades of brightness: within a third of a stop below the goal, in at most five frames.
TEST(ExposureSearch, PutsThePeakJustBelowTheGoal) {
  for (double rate = 0.3; rate < 3000.0; rate *= 1.3) {
    const Result<Outcome> outcome = Search(rate, 0.5);
    ASSERT_TRUE(outcome) << rate << outcome.error().message;
    ASSERT_EQ(outcome->exposures_s.size(), 1U) << rate;
    const double peak = rate * outcome->exposures_s[0];
    EXPECT_LE(peak, 0.8 * 1.0201) << rate;
    EXPECT_GT(peak, 0.8 / std::cbrt(2.0)) << rate;
    EXPECT_LE(outcome->tests, 5) << rate;
  }
}

TEST(ExposureSearch, BracketsWhatOneExposureCannotHold) {
  const double rate = 40.0;  // 1/50 s at the goal
  const auto count = [&](double dark, int most) {
    return Search(rate, dark, {.most = most})->exposures_s.size();
  };
  EXPECT_EQ(count(0.01, 3), 1U);
  EXPECT_EQ(count(0.004, 3), 2U);
  EXPECT_EQ(count(0.0004, 3), 3U);
  EXPECT_EQ(count(0.0004, 2), 2U);
  EXPECT_EQ(count(0.0004, 1), 1U);
  EXPECT_EQ(count(0.00004, 3), 3U);
  const std::vector<double> exposures = Search(rate, 0.0004)->exposures_s;
  EXPECT_THAT(exposures[1] / exposures[0], DoubleNear(8.0, 0.2));
  EXPECT_THAT(exposures[2] / exposures[1], DoubleNear(8.0, 0.2));
}

// A light may be on for so long only.
TEST(ExposureSearch, StaysBelowTheLongestTime) {
  const std::vector<double> exposures = Search(0.5, 0.0001, {.longest_s = 2.0})->exposures_s;
  EXPECT_LE(exposures.back(), 2.0);
  EXPECT_LE(Search(0.01, 0.5, {.longest_s = 2.0})->exposures_s[0], 2.0);
}

// A camera with three times far apart: clipped at one, all but black at the next.
TEST(ExposureSearch, EndsBetweenTimesThatAreFarApart) {
  Result<ExposureSearch> search = ExposureSearch::Begin({0.001, 0.02, 1.0}, {});
  ASSERT_TRUE(search);
  for (int test = 0; test < 4 && !search->Found(); ++test) {
    const double rate = 60.0;  // clips at 0.02 s, shows 6 % at 0.001 s
    const double t = search->TestTime();
    ASSERT_TRUE(search->Take({.peak = std::min(1.0, rate * t), .low = 0.5 * rate * t}));
  }
  EXPECT_THAT(search->Exposures(), ElementsAre(0.001));
}

TEST(ExposureSearch, SaysWhatCannotBeExposed) {
  EXPECT_THAT(Search(1e6, 0.5).error(), IsError(ErrorCode::kBadData, "too bright"));
  EXPECT_THAT(Search(1e-5, 0.5).error(), IsError(ErrorCode::kBadData, "the picture is black"));
  EXPECT_THAT(ExposureSearch::Begin({}, {}).error(),
              IsError(ErrorCode::kInvalidArgument, "--exposure"));
}

// At the level found, the signal is ten times its noise; a longer exposure would do nothing above
// it.
TEST(ExposureSearch, TheDarkestUsefulSignalIsTenTimesItsNoise) {
  Response response{.black = 600.0, .white = 15'520.0};
  EXPECT_EQ(DarkestUseful(response), 0.004);
  EXPECT_EQ(DarkestUseful(std::nullopt), 0.004);
  response.gain_dn_per_electron = 0.25;
  response.read_noise_dn = 4.0;
  const double s = DarkestUseful(response) * (15'520.0 - 600.0);
  EXPECT_NEAR(s / std::sqrt(0.25 * s + 16.0), 10.0, 1e-9);
}

}  // namespace
}  // namespace sateen::exposure_search_test
