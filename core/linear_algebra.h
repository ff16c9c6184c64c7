#pragma once

#include <Eigen/Core>

// Eigen's decompositions behind plain functions. They are compiled once, in linear_algebra.cc: a
// source that includes <Eigen/Dense> and uses one takes 5 to 15 s more to compile.
namespace sateen {

// Returns the x of a x = b for a symmetric a, from P^T L D L^T P = a with pivots, in double.
//
// a        N x N, positive or negative semidefinite; only its lower triangle is read
// b        N x M, a system per column
// Returns  N x M. Where a is singular: one of the solutions, or entries that are not finite
// Cost     N^3 / 3 + 2 N^2 M flops; allocates unless N = 3 and M = 1
[[nodiscard]] Eigen::Vector3d SolveSymmetric(const Eigen::Matrix3d& a, const Eigen::Vector3d& b);
[[nodiscard]] Eigen::VectorXd SolveSymmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);
[[nodiscard]] Eigen::MatrixXd SolveSymmetric(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
template <int N, int M>
[[nodiscard]] Eigen::Matrix<double, N, M> SolveSymmetric(const Eigen::Matrix<double, N, N>& a,
                                                         const Eigen::Matrix<double, N, M>& b) {
  return SolveSymmetric(Eigen::MatrixXd(a), Eigen::MatrixXd(b));
}

// Returns a^-1 of a symmetric a: SolveSymmetric(a, I).
template <int N>
[[nodiscard]] Eigen::Matrix<double, N, N> InverseOfSymmetric(const Eigen::Matrix<double, N, N>& a) {
  return SolveSymmetric(Eigen::MatrixXd(a),
                        Eigen::MatrixXd(Eigen::MatrixXd::Identity(a.rows(), a.cols())));
}

// Returns the least entry of the D of SolveSymmetric(): 0 where a is singular, but for rounding.
[[nodiscard]] double LeastPivot(const Eigen::Matrix3d& a);

// Returns the eigenvalues of a symmetric a in ascending order, each with an error of about
// 1e-16 |a|.
[[nodiscard]] Eigen::Vector3d SymmetricEigenvalues(const Eigen::Matrix3d& a);

// a = V diag(values) V^T with orthonormal V.
struct SymmetricEigen {
  Eigen::VectorXd values;   // in ascending order
  Eigen::MatrixXd vectors;  // V: column j belongs to values[j]
};

// Decomposes a symmetric a by QR steps on its tridiagonal form. O(N^3); allocates.
[[nodiscard]] SymmetricEigen DecomposeSymmetric(const Eigen::MatrixXd& a);

// Returns the condition number sigma_1 / sigma_3 of a K x 3 matrix L from its Gram matrix L^T L:
//
//     cond(L) = sqrt(lambda_3 / lambda_1),     lambda_1 <= lambda_2 <= lambda_3 of L^T L.
//
// Infinite where lambda_1 <= 0. The Gram matrix holds the square of the condition number: above
// about 1 / sqrt(epsilon) = 6.7e7 the result is rounding and L is singular.
[[nodiscard]] double ConditionOfGram(const Eigen::Matrix3d& gram);

// Returns argmin_x |l x - i|^2 from the normal equations l^T l x = l^T i by SolveSymmetric().
//
// l        K x 3, K >= 3
// i        K x M, a system per column
// Returns  3 x M. Its error grows with cond(l)^2: above about 1e6 use SolveBySvd()
// Cost     O(K M)
[[nodiscard]] Eigen::Vector3d SolveNormalEquations(const Eigen::MatrixX3d& l,
                                                   const Eigen::VectorXd& i);
[[nodiscard]] Eigen::Matrix<double, 3, 4> SolveNormalEquations(const Eigen::MatrixX3d& l,
                                                               const Eigen::MatrixX4d& i);

// Returns argmin_x |l x - i|^2 by Householder QR with column pivoting. Shapes as above; allocates.
[[nodiscard]] Eigen::MatrixXd SolveByQr(const Eigen::MatrixXd& l, const Eigen::MatrixXd& i);

// Result of SolveBySvd().
struct SvdSolution {
  Eigen::MatrixXd x;
  double condition = 0.0;  // largest singular value / smallest; infinite where that is 0
};

// Returns the shortest argmin_x |l x - i|^2 by Eigen's JacobiSVD in double, of dynamic size: the
// reference of this project. Singular values below 2 epsilon sigma_1 count as zero. Allocates.
[[nodiscard]] SvdSolution SolveBySvd(const Eigen::MatrixXd& l, const Eigen::MatrixXd& i);

// Returns U V^T of the singular value decomposition a = U diag(sigma) V^T: the orthogonal matrix
// nearest to a in the Frobenius norm, a rotation where det(a) > 0.
[[nodiscard]] Eigen::Matrix3d NearestOrthogonal(const Eigen::Matrix3d& a);

}  // namespace sateen
