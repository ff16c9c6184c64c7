#include "core/gauss_newton.h"

#include <Eigen/Cholesky>
#include <type_traits>

namespace sateen {
namespace {

constexpr double kLeastOwnPart = 1e-13;
constexpr int kMaxFixed = 8;

// One type for every fixed N, on the stack: LDLT for each N of its own takes minutes to compile.
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxFixed, kMaxFixed>;
template <int N>
using Working = std::conditional_t<N == Eigen::Dynamic, Eigen::MatrixXd, SmallMatrix>;
template <int N>
using WorkingVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, Working<N>::MaxRowsAtCompileTime>;

}  // namespace

template <int N>
Unknowns<N> SolveNormal(const UnknownsMatrix<N>& a, const Unknowns<N>& b) {
  const WorkingVector<N> right = b;
  const WorkingVector<N> x = Eigen::LDLT<Working<N>>(Working<N>(a)).solve(right);
  return x;
}

template <int N>
std::optional<UnknownsMatrix<N>> CovarianceOf(const UnknownsMatrix<N>& a) {
  const Unknowns<N> scale = a.diagonal().cwiseSqrt().cwiseInverse();
  const Working<N> correlations = scale.asDiagonal() * a * scale.asDiagonal();
  // D of L D L^T: the rest of each diagonal element, here 1, once the unknowns before are known.
  const WorkingVector<N> own_part = Eigen::LDLT<Working<N>>(correlations).vectorD();
  if (!correlations.allFinite() || !(own_part.array() > kLeastOwnPart).all()) {
    return std::nullopt;
  }
  const Eigen::LDLT<Working<N>> factors{Working<N>(a)};
  UnknownsMatrix<N> inverse(a.rows(), a.cols());
  for (Eigen::Index column = 0; column < a.cols(); ++column) {
    const WorkingVector<N> unit = WorkingVector<N>::Unit(a.rows(), column);
    const WorkingVector<N> x = factors.solve(unit);
    inverse.col(column) = x;
  }
  return inverse;
}

#define SATEEN_INSTANTIATE(N)                                                            \
  template Unknowns<N> SolveNormal<N>(const UnknownsMatrix<N>& a, const Unknowns<N>& b); \
  template std::optional<UnknownsMatrix<N>> CovarianceOf<N>(const UnknownsMatrix<N>& a)
SATEEN_INSTANTIATE(1);
SATEEN_INSTANTIATE(2);
SATEEN_INSTANTIATE(3);
SATEEN_INSTANTIATE(4);
SATEEN_INSTANTIATE(5);
SATEEN_INSTANTIATE(6);
SATEEN_INSTANTIATE(7);
SATEEN_INSTANTIATE(8);
SATEEN_INSTANTIATE(Eigen::Dynamic);
#undef SATEEN_INSTANTIATE

}  // namespace sateen
