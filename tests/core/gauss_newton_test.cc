#include "core/gauss_newton.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <random>
#include <vector>

namespace sateen::gauss_newton_test {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

const auto kPlus = [](const auto& x, const auto& step) { return (x + step).eval(); };

// y = x0 + x1 t + x2 t^2 at t = -2, -1 ... 2, exactly.
NormalEquations<3> Parabola(const Vector3d& x, const Vector3d& truth) {
  NormalEquations<3> equations;
  for (int t = -2; t <= 2; ++t) {
    const Vector3d row(1.0, t, t * t);
    equations.Add(row, row.dot(truth - x), 1.0 + t * t);
  }
  return equations;
}

TEST(MinimizeSquares, SolvesALinearProblemInOneStep) {
  const Vector3d truth(3.0, -1.0, 0.5);
  for (const StepRule rule : {StepRule::kFull, StepRule::kHalving}) {
    const auto fit = MinimizeSquares<3>(Vector3d(10.0, 20.0, 30.0),
                                        [&](const Vector3d& x) { return Parabola(x, truth); },
                                        kPlus, {.rule = rule, .max_iterations = 1});
    EXPECT_LT((fit.state - truth).norm(), 1e-12);
    EXPECT_GT(fit.start_cost, 1e3);
    EXPECT_LT(fit.equations.cost, 1e-20);
  }
}

TEST(MinimizeSquares, StopsAtAnExactAnswer) {
  const Vector3d truth(3.0, -1.0, 0.5);
  const auto fit = MinimizeSquares<3>(
      truth, [&](const Vector3d& x) { return Parabola(x, truth); }, kPlus);
  EXPECT_EQ(fit.end, GaussNewtonEnd::kConverged);
  EXPECT_EQ(fit.iterations, 0);
}

// r = (10 (x1 - x0^2), 1 - x0), from the usual start (-1.2, 1); the minimum is at (1, 1).
NormalEquations<2> Rosenbrock(const Vector2d& x) {
  NormalEquations<2> equations;
  equations.Add({20.0 * x[0], -10.0}, 10.0 * (x[1] - x[0] * x[0]));
  equations.Add({1.0, 0.0}, 1.0 - x[0]);
  return equations;
}

TEST(MinimizeSquares, FollowsTheValleyOfRosenbrock) {
  for (const StepRule rule : {StepRule::kFull, StepRule::kHalving, StepRule::kDamping}) {
    const auto fit = MinimizeSquares<2>(Vector2d(-1.2, 1.0), Rosenbrock, kPlus, {.rule = rule});
    EXPECT_EQ(fit.end, GaussNewtonEnd::kConverged);
    EXPECT_LT((fit.state - Vector2d(1.0, 1.0)).norm(), 1e-8);
    EXPECT_NEAR(fit.start_cost, 24.2, 1e-12);
  }
}

TEST(MinimizeSquares, HalvesAndDampsStepsThatOvershoot) {
  // atan(x) = 0 from x = 3: full steps of Newton's method diverge.
  const auto arc_tangent = [](double x) {
    NormalEquations<1> equations;
    equations.Add(Unknowns<1>(1.0 / (1.0 + x * x)), -std::atan(x));
    return equations;
  };
  const auto move = [](double x, const Unknowns<1>& step) { return x + step[0]; };
  const auto end_of = [&](StepRule rule) {
    return MinimizeSquares<1>(3.0, arc_tangent, move, {.rule = rule});
  };
  EXPECT_NEAR(end_of(StepRule::kHalving).state, 0.0, 1e-9);
  EXPECT_NEAR(end_of(StepRule::kDamping).state, 0.0, 1e-9);
  EXPECT_EQ(end_of(StepRule::kHalving).end, GaussNewtonEnd::kConverged);
  EXPECT_EQ(end_of(StepRule::kDamping).end, GaussNewtonEnd::kConverged);
  EXPECT_GT(std::abs(end_of(StepRule::kFull).state), 1e6);
}

TEST(MinimizeSquares, GivesThePriorWithoutData) {
  const Vector2d mean(2.0, -7.0);
  const Matrix2d covariance{{4.0, 0.6}, {0.6, 0.25}};
  const auto fit = MinimizeSquares<2>(
      Vector2d(100.0, 50.0),
      [&](const Vector2d& x) {
        NormalEquations<2> equations;
        equations.AddPrior(x - mean, covariance.inverse());
        return equations;
      },
      kPlus);
  EXPECT_LT((fit.state - mean).norm(), 1e-9);
  const auto found = CovarianceOf<2>(fit.equations.information);
  ASSERT_TRUE(found);
  EXPECT_LT((*found - covariance).norm(), 1e-12);
}

TEST(MinimizeSquares, WeighsDataAgainstThePrior) {
  // One measurement of variance 0.5 at 10 and a prior of variance 1.5 at 2.
  const auto fit = MinimizeSquares<1>(
      Unknowns<1>(0.0),
      [](const Unknowns<1>& x) {
        NormalEquations<1> equations;
        equations.Add(Unknowns<1>(1.0), 10.0 - x[0], 1.0 / 0.5);
        equations.AddPrior(x - Unknowns<1>(2.0), UnknownsMatrix<1>(1.0 / 1.5));
        return equations;
      },
      kPlus);
  EXPECT_NEAR(fit.state[0], (10.0 / 0.5 + 2.0 / 1.5) / (1.0 / 0.5 + 1.0 / 1.5), 1e-12);
  EXPECT_NEAR(fit.equations.cost, 64.0 / (0.5 + 1.5), 1e-12);  // d^2 over the sum of variances
}

// y = x0 exp(-x1 t) with noise: what the covariance predicts is how the answers scatter.
TEST(CovarianceOf, IsTheScatterOfTheAnswers) {
  constexpr double kSd = 0.02;
  constexpr int kTrials = 4000;
  const Vector2d truth(2.0, 0.7);
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, kSd);
  Matrix2d scatter = Matrix2d::Zero();
  Matrix2d predicted = Matrix2d::Zero();
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> y;
    for (int t = 0; t < 12; ++t) {
      y.push_back(truth[0] * std::exp(-truth[1] * 0.25 * t) + noise(random));
    }
    const auto fit = MinimizeSquares<2>(
        Vector2d(1.5, 0.5),
        [&](const Vector2d& x) {
          NormalEquations<2> equations;
          for (size_t k = 0; k < y.size(); ++k) {
            const double t = 0.25 * static_cast<double>(k);
            const double e = std::exp(-x[1] * t);
            equations.Add({e, -x[0] * t * e}, y[k] - x[0] * e, 1.0 / (kSd * kSd));
          }
          return equations;
        },
        kPlus);
    ASSERT_EQ(fit.end, GaussNewtonEnd::kConverged);
    scatter += (fit.state - truth) * (fit.state - truth).transpose() / kTrials;
    predicted += *CovarianceOf<2>(fit.equations.information) / kTrials;
  }
  // A variance of 4000 trials is known to 2.2 %.
  EXPECT_NEAR(scatter(0, 0) / predicted(0, 0), 1.0, 0.08);
  EXPECT_NEAR(scatter(1, 1) / predicted(1, 1), 1.0, 0.08);
  EXPECT_NEAR(scatter(0, 1) / predicted(0, 1), 1.0, 0.12);
}

TEST(CovarianceOf, IsNothingWhereAnUnknownIsNotDetermined) {
  EXPECT_FALSE(CovarianceOf<2>(Matrix2d{{1.0, 2.0}, {2.0, 4.0}}));
  EXPECT_FALSE(CovarianceOf<2>(Matrix2d{{1.0, 0.0}, {0.0, 0.0}}));
  EXPECT_FALSE(CovarianceOf<2>(Matrix2d{{1.0, 3.0}, {3.0, 1.0}}));
  EXPECT_FALSE(CovarianceOf<2>(Matrix2d::Constant(std::numeric_limits<double>::quiet_NaN())));
  // Units do not matter: a metre and a nanometre, both known.
  const auto found = CovarianceOf<2>(Matrix2d{{1e18, 0.0}, {0.0, 1.0}});
  ASSERT_TRUE(found);
  EXPECT_DOUBLE_EQ((*found)(0, 0), 1e-18);
}

TEST(CovarianceOf, TakesAnyNumberOfUnknowns) {
  NormalEquations<Eigen::Dynamic> equations(2);
  equations.AddPrior(Vector2d(0.0, 0.0), Matrix2d{{2.0, 0.0}, {0.0, 8.0}});
  const auto found = CovarianceOf<Eigen::Dynamic>(equations.information);
  ASSERT_TRUE(found);
  EXPECT_DOUBLE_EQ((*found)(1, 1), 0.125);
}

TEST(MinimizeSquares, TellsAWrongDerivative) {
  for (const StepRule rule : {StepRule::kHalving, StepRule::kDamping}) {
    const auto fit = MinimizeSquares<1>(Unknowns<1>(5.0),
                                        [](const Unknowns<1>& x) {
                                          NormalEquations<1> equations;
                                          equations.Add(Unknowns<1>(-2.0),
                                                        6.0 - 2.0 * x[0]);  // the derivative is +2
                                          return equations;
                                        },
                                        kPlus, {.rule = rule});
    EXPECT_EQ(fit.end, GaussNewtonEnd::kNoDescent);
    EXPECT_EQ(fit.state[0], 5.0);
  }
}

TEST(MinimizeSquares, TellsThatItDidNotConverge) {
  const auto fit =
      MinimizeSquares<2>(Vector2d(-1.2, 1.0), Rosenbrock, kPlus, {.max_iterations = 3});
  EXPECT_EQ(fit.end, GaussNewtonEnd::kMaxIterations);
  EXPECT_EQ(fit.iterations, 3);
  EXPECT_LT(fit.equations.cost, fit.start_cost);
}

TEST(MinimizeSquares, TellsNumbersThatAreNotFinite) {
  const auto fit = MinimizeSquares<1>(
      Unknowns<1>(1.0),
      [](const Unknowns<1>& /*x*/) {
        NormalEquations<1> equations;
        equations.Add(Unknowns<1>(1.0), std::numeric_limits<double>::infinity());
        return equations;
      },
      kPlus);
  EXPECT_EQ(fit.end, GaussNewtonEnd::kNotFinite);
}

TEST(MinimizeSquares, EndsByTheGainOrByTheStep) {
  const auto root = [](const Unknowns<1>& x) {  // x^2 = 2
    NormalEquations<1> equations;
    equations.Add(Unknowns<1>(2.0 * x[0]), 2.0 - x[0] * x[0]);
    return equations;
  };
  const auto by_gain = MinimizeSquares<1>(Unknowns<1>(1.5), root, kPlus,
                                          {.min_relative_fall = 0.0, .min_gain = 1e-3});
  EXPECT_EQ(by_gain.iterations, 1);  // costs 0.0625, 4.8e-5
  const auto by_step =
      MinimizeSquares<1>(Unknowns<1>(1.5), root, kPlus, {.min_relative_fall = 0.0},
                         [](const Unknowns<1>& step) { return std::abs(step[0]) < 0.01; });
  EXPECT_EQ(by_step.iterations, 2);  // steps -0.083, -0.0025
  EXPECT_EQ(by_gain.end, GaussNewtonEnd::kConverged);
  EXPECT_EQ(by_step.end, GaussNewtonEnd::kConverged);
}

}  // namespace
}  // namespace sateen::gauss_newton_test
