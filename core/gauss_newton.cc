#include "core/gauss_newton.h"

#include <Eigen/Cholesky>

namespace sateen {
namespace {

constexpr double kLeastOwnPart = 1e-13;

}  // namespace

template <int N>
Unknowns<N> SolveNormal(const UnknownsMatrix<N>& a, const Unknowns<N>& b) {
  return a.ldlt().solve(b);
}

template <int N>
std::optional<UnknownsMatrix<N>> CovarianceOf(const UnknownsMatrix<N>& a) {
  const Unknowns<N> scale = a.diagonal().cwiseSqrt().cwiseInverse();
  const UnknownsMatrix<N> correlations = scale.asDiagonal() * a * scale.asDiagonal();
  // D of L D L^T: what remains of each diagonal element, here 1, once the unknowns before are known.
  const Unknowns<N> own_part = correlations.ldlt().vectorD();
  if (!correlations.allFinite() || !(own_part.array() > kLeastOwnPart).all()) {
    return std::nullopt;
  }
  return a.ldlt().solve(UnknownsMatrix<N>::Identity(a.rows(), a.cols()));
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
