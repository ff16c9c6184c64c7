#include "core/linear_algebra.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace sateen::linear_algebra_test {
namespace {

constexpr double kExact = 1e-14;  // a few roundings of numbers near 1

// L = B diag(1, 2, 4) with orthonormal columns in B, so that cond(L) = 4.
Eigen::MatrixX3d LightsOfCondition4() {
  Eigen::MatrixX3d b(4, 3);
  b << 0.5, 0.5, 0.5, 0.5, -0.5, 0.5, 0.5, 0.5, -0.5, 0.5, -0.5, -0.5;
  return b * Eigen::Vector3d(1.0, 2.0, 4.0).asDiagonal();
}

// A symmetric matrix that is neither diagonal nor positive definite in its leading entry.
Eigen::MatrixXd Symmetric(Eigen::Index size) {
  Eigen::MatrixXd a(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j < size; ++j) {
      a(i, j) = 1.0 / static_cast<double>(1 + i + j) + (i == j ? static_cast<double>(i) : 0.0);
    }
  }
  return a;
}

TEST(SolveSymmetric, SolvesEachShape) {
  const Eigen::MatrixXd a = Symmetric(6);
  const Eigen::MatrixXd x = Eigen::MatrixXd::Random(6, 4);
  const Eigen::Matrix3d a3 = a.topLeftCorner<3, 3>();
  const Eigen::Vector3d x3(1.0, -2.0, 3.0);
  const Eigen::Matrix<double, 6, 6> a6 = a;
  const Eigen::Matrix<double, 6, 1> x6 = x.col(0);

  EXPECT_LT((SolveSymmetric(a3, Eigen::Vector3d(a3 * x3)) - x3).norm(), 1e-12);
  EXPECT_LT((SolveSymmetric(a6, Eigen::Matrix<double, 6, 1>(a6 * x6)) - x6).norm(), 1e-12);
  EXPECT_LT((SolveSymmetric(a, Eigen::VectorXd(a * x.col(1))) - x.col(1)).norm(), 1e-12);
  EXPECT_LT((SolveSymmetric(a, Eigen::MatrixXd(a * x)) - x).norm(), 1e-12);
}

TEST(SolveSymmetric, ReadsTheLowerTriangleOnly) {
  Eigen::Matrix3d a = Symmetric(3);
  const Eigen::Vector3d b(1.0, 2.0, 3.0);
  const Eigen::Vector3d x = SolveSymmetric(a, b);
  a(0, 2) = 1e3;

  EXPECT_EQ(SolveSymmetric(a, b), x);
}

TEST(InverseOfSymmetric, GivesTheIdentityWithItsMatrix) {
  const Eigen::MatrixXd a = Symmetric(7);
  const Eigen::Matrix<double, 7, 7> a7 = a;

  EXPECT_LT((InverseOfSymmetric(a) * a - Eigen::MatrixXd::Identity(7, 7)).norm(), 1e-12);
  EXPECT_LT((InverseOfSymmetric(a7) * a7 - Eigen::MatrixXd::Identity(7, 7)).norm(), 1e-12);
}

TEST(LeastPivot, IsTheLeastEntryOfADiagonalAndZeroInAPlane) {
  EXPECT_EQ(LeastPivot(Eigen::Vector3d(2.0, 0.25, 1.0).asDiagonal()), 0.25);

  const Eigen::Vector3d u(1.0, 2.0, 3.0);
  const Eigen::Vector3d v(-1.0, 0.5, 2.0);
  EXPECT_NEAR(LeastPivot(u * u.transpose() + v * v.transpose()), 0.0, kExact);
}

TEST(DecomposeSymmetric, GivesTheMatrixBackInAscendingOrder) {
  const Eigen::MatrixXd a = Symmetric(5);

  const SymmetricEigen eigen = DecomposeSymmetric(a);

  for (Eigen::Index i = 1; i < 5; ++i) {
    EXPECT_LT(eigen.values[i - 1], eigen.values[i]);
  }
  EXPECT_LT((eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose() - a).norm(),
            kExact * a.norm());
  EXPECT_LT((eigen.vectors.transpose() * eigen.vectors - Eigen::MatrixXd::Identity(5, 5)).norm(),
            kExact);
}

TEST(SymmetricEigenvalues, AgreeWithTheDecomposition) {
  const Eigen::Matrix3d a = Symmetric(3);

  EXPECT_LT((SymmetricEigenvalues(a) - DecomposeSymmetric(a).values).norm(), kExact * a.norm());
}

TEST(ConditionOfGram, IsTheRatioOfTheSingularValues) {
  const Eigen::MatrixX3d l = LightsOfCondition4();

  EXPECT_NEAR(ConditionOfGram(l.transpose() * l), 4.0, 1e-13);
}

TEST(ConditionOfGram, IsInfiniteOrAboveItsFloorInAPlane) {
  Eigen::MatrixX3d l = LightsOfCondition4();
  l.col(2) = l.col(0) - 0.3 * l.col(1);

  EXPECT_GT(ConditionOfGram(l.transpose() * l), 1e7);
  EXPECT_EQ(ConditionOfGram(Eigen::Vector3d(1.0, 1.0, 0.0).asDiagonal()),
            std::numeric_limits<double>::infinity());
}

// i = L x + e with e orthogonal to the columns of L, which no least-squares solution sees.
TEST(LeastSquares, IsTheSameByEachDecomposition) {
  const Eigen::MatrixX3d l = LightsOfCondition4();
  const Eigen::Vector4d across(0.5, -0.5, -0.5, 0.5);
  Eigen::Matrix<double, 3, 4> x;
  x << 0.1, 0.2, -0.3, 0.0, 0.4, 0.5, 0.6, 1.0, 0.7, -0.8, 0.9, 2.0;
  const Eigen::MatrixX4d i = l * x + across * Eigen::RowVector4d(1.0, 2.0, 3.0, 4.0);
  const Eigen::VectorXd last = i.col(3);

  EXPECT_LT((SolveNormalEquations(l, i) - x).norm(), 1e-13);
  EXPECT_LT((SolveNormalEquations(l, last) - x.col(3)).norm(), 1e-13);
  EXPECT_LT((SolveByQr(l, i) - x).norm(), kExact);
  EXPECT_LT((SolveBySvd(l, i).x - x).norm(), kExact);
  EXPECT_NEAR(SolveBySvd(l, last).condition, 4.0, kExact);
}

TEST(SolveBySvd, GivesTheShortestOfManySolutions) {
  Eigen::MatrixX3d l = LightsOfCondition4();
  l.col(2).setZero();  // x[2] is free

  const SvdSolution solution = SolveBySvd(l, Eigen::MatrixXd(l * Eigen::Vector3d(1.0, 2.0, 3.0)));

  EXPECT_LT((solution.x - Eigen::Vector3d(1.0, 2.0, 0.0)).norm(), kExact);
  EXPECT_EQ(solution.condition, std::numeric_limits<double>::infinity());
}

TEST(NearestOrthogonal, TakesTheStretchOutOfARotation) {
  const double turn = 0.3;
  Eigen::Matrix3d r;
  r << std::cos(turn), -std::sin(turn), 0.0, std::sin(turn), std::cos(turn), 0.0, 0.0, 0.0, 1.0;
  Eigen::Matrix3d stretch;  // symmetric and positive definite: the other factor of the polar form
  stretch << 1.1, 0.05, 0.0, 0.05, 0.9, 0.02, 0.0, 0.02, 1.0;

  EXPECT_LT((NearestOrthogonal(r * stretch) - r).norm(), kExact);
}

}  // namespace
}  // namespace sateen::linear_algebra_test
