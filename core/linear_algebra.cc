#include "core/linear_algebra.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

namespace sateen {
namespace {

// Column by column: systems of several columns at once would bring Eigen's blocked solver into each
// decomposition, which takes longer to compile than all the rest.
template <typename Decomposition>
Eigen::MatrixXd SolveColumns(const Decomposition& of_a, Eigen::Index unknowns,
                             const Eigen::MatrixXd& b) {
  Eigen::MatrixXd x(unknowns, b.cols());
  for (Eigen::Index column = 0; column < b.cols(); ++column) {
    const Eigen::VectorXd right = b.col(column);
    x.col(column) = of_a.solve(right);
  }
  return x;
}

}  // namespace

Eigen::Vector3d SolveSymmetric(const Eigen::Matrix3d& a, const Eigen::Vector3d& b) {
  return a.ldlt().solve(b);
}

Eigen::VectorXd SolveSymmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
  return a.ldlt().solve(b);
}

Eigen::MatrixXd SolveSymmetric(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return SolveColumns(a.ldlt(), a.cols(), b);
}

double LeastPivot(const Eigen::Matrix3d& a) { return a.ldlt().vectorD().minCoeff(); }

Eigen::Vector3d SymmetricEigenvalues(const Eigen::Matrix3d& a) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

SymmetricEigen DecomposeSymmetric(const Eigen::MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

double ConditionOfGram(const Eigen::Matrix3d& gram) {
  const Eigen::Vector3d lambda = SymmetricEigenvalues(gram);
  return lambda[0] > 0.0 ? std::sqrt(lambda[2] / lambda[0])
                         : std::numeric_limits<double>::infinity();
}

Eigen::Vector3d SolveNormalEquations(const Eigen::MatrixX3d& l, const Eigen::VectorXd& i) {
  return SolveSymmetric(Eigen::Matrix3d(l.transpose() * l), Eigen::Vector3d(l.transpose() * i));
}

Eigen::Matrix<double, 3, 4> SolveNormalEquations(const Eigen::MatrixX3d& l,
                                                 const Eigen::MatrixX4d& i) {
  const Eigen::LDLT<Eigen::Matrix3d> normal_matrix(l.transpose() * l);
  const Eigen::Matrix<double, 3, 4> right = l.transpose() * i;
  Eigen::Matrix<double, 3, 4> x;
  for (Eigen::Index column = 0; column < 4; ++column) {
    const Eigen::Vector3d b = right.col(column);
    x.col(column) = normal_matrix.solve(b);
  }
  return x;
}

Eigen::MatrixXd SolveByQr(const Eigen::MatrixXd& l, const Eigen::MatrixXd& i) {
  return SolveColumns(l.colPivHouseholderQr(), l.cols(), i);
}

SvdSolution SolveBySvd(const Eigen::MatrixXd& l, const Eigen::MatrixXd& i) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(l, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Eigen::VectorXd& sigma = svd.singularValues();
  return {svd.solve(i), sigma[0] / sigma[sigma.size() - 1]};
}

Eigen::Matrix3d NearestOrthogonal(const Eigen::Matrix3d& a) {
  const Eigen::MatrixXd dynamic = a;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(dynamic, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Eigen::Matrix3d u = svd.matrixU();
  const Eigen::Matrix3d v = svd.matrixV();
  return u * v.transpose();
}

}  // namespace sateen
