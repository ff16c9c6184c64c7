#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace sateen {

template <int N>
using Unknowns = Eigen::Matrix<double, N, 1>;
template <int N>
using UnknownsMatrix = Eigen::Matrix<double, N, N>;

/// Normal equations of N unknowns x at one estimate of them: residuals r = measured - predicted,
/// J = d predicted / d x, weights W, and a prior of mean m and precision P, an inverse covariance:
///
///     A = J^T W J + P                                                               (1)
///     b = J^T W r - P (x - m)                                                       (2)
///     cost = r^T W r + (x - m)^T P (x - m)                                          (3)
///
/// A^-1 b is the step of Gauss and Newton's method. Where W is the inverse covariance of the
/// measurements, A^-1 is the covariance of the unknowns. All sums start at zero.
template <int N>
struct NormalEquations {
  NormalEquations() : NormalEquations(N) {}
  // For N = Eigen::Dynamic, whose matrices are on the heap.
  explicit NormalEquations(Eigen::Index count)
      : information(UnknownsMatrix<N>::Zero(count, count)), gradient(Unknowns<N>::Zero(count)) {}

  // Adds one measurement; `jacobian` is its row of J.
  void Add(const Unknowns<N>& jacobian, double residual, double weight = 1.0) {
    information.noalias() += weight * jacobian * jacobian.transpose();
    gradient += weight * residual * jacobian;
    cost += weight * residual * residual;
  }

  // Adds a prior; `from_mean` is x - m.
  void AddPrior(const Unknowns<N>& from_mean, const UnknownsMatrix<N>& precision) {
    const Unknowns<N> pull = precision * from_mean;
    information += precision;
    gradient -= pull;
    cost += from_mean.dot(pull);
  }

  UnknownsMatrix<N> information;  // A
  Unknowns<N> gradient;           // b: minus half the gradient of the cost
  double cost = 0.0;
};

// How far one iteration goes along its step.
enum class StepRule {
  kFull,     // all of A^-1 b, whether the cost falls or not
  kHalving,  // A^-1 b, halved until the cost falls
  kDamping   // Levenberg and Marquardt: (A + damping diag A)^-1 b, damping times 10 until it falls
};

struct GaussNewtonOptions {
  StepRule rule = StepRule::kHalving;
  int max_iterations = 50;  // steps taken
  int max_attempts = 20;    // steps tried in one iteration
  // Share of the cost: converged once an iteration lowers the cost by less; with kFull, once its
  // step promises less, b^T A^-1 b. 0: not by this.
  double min_relative_fall = 1e-12;
  // Fall of the cost that A^-1 b promises, b^T A^-1 b: converged once it is not above this; that
  // step is not taken.
  double min_gain = 0.0;
  // Damping of the first step; it is divided by 10 after each step taken.
  double damping = 1e-6;
  double min_damping = 1e-12;
  double max_damping = 1e6;  // above it no step helps
};

enum class GaussNewtonEnd {
  kConverged,
  kNoDescent,      // no step lowers the cost, though J promises that it falls: J is wrong
  kMaxIterations,  // not converged
  kNotFinite       // cost or step are not finite: a bad start, or equations without an answer
};

template <int N, typename State>
struct GaussNewtonFit {
  State state;                   // last one
  NormalEquations<N> equations;  // at `state`
  double start_cost = 0.0;
  int iterations = 0;  // steps taken
  GaussNewtonEnd end = GaussNewtonEnd::kMaxIterations;
};

/// Returns A^-1 b by Cholesky's factors with pivoting. Where A is singular the result is not finite
/// or one of many. N is 1 to 8 or Eigen::Dynamic.
template <int N>
[[nodiscard]] Unknowns<N> SolveNormal(const UnknownsMatrix<N>& a, const Unknowns<N>& b);

/// Returns A^-1; nothing where A does not determine every unknown. That is so where the part of an
/// unknown that the others do not explain is below 1e-13 of its diagonal element; the unknowns'
/// units have no say in it. N is 1 to 8 or Eigen::Dynamic.
template <int N>
[[nodiscard]] std::optional<UnknownsMatrix<N>> CovarianceOf(const UnknownsMatrix<N>& a);

// Returns (A + damping diag A)^-1 b.
template <int N>
[[nodiscard]] Unknowns<N> DampedStep(const NormalEquations<N>& equations, double damping) {
  UnknownsMatrix<N> a = equations.information;
  a.diagonal() *= 1.0 + damping;
  return SolveNormal<N>(a, equations.gradient);
}

/// Minimizes (3) from `start` by Gauss and Newton's method.
///
/// State     any value: a vector, a pose ...
/// evaluate  NormalEquations<N>(const State&): (1) to (3) there
/// move      State(const State&, const Unknowns<N>& step); for a vector, x + step
/// settled   bool(const Unknowns<N>& step): true ends the method, converged, after that step
/// Returns   the last state, its equations, and why the method ended. It returns a state that is
///           not converged, too: the caller decides by `end`.
/// Cost      one call of `evaluate` at the start and one per step tried; no allocation if N is
///           fixed
template <int N, typename State, typename Evaluate, typename Move, typename Settled>
[[nodiscard]] GaussNewtonFit<N, State> MinimizeSquares(const State& start, const Evaluate& evaluate,
                                                       const Move& move,
                                                       const GaussNewtonOptions& options,
                                                       const Settled& settled) {
  GaussNewtonFit<N, State> fit{start, evaluate(start)};
  fit.start_cost = fit.equations.cost;
  double damping = options.rule == StepRule::kDamping ? options.damping : 0.0;
  const auto ended = [&](GaussNewtonEnd end) {
    fit.end = end;
    return fit;
  };
  while (fit.iterations < options.max_iterations) {
    const double before = fit.equations.cost;
    Unknowns<N> step = DampedStep(fit.equations, damping);
    if (!std::isfinite(before) || !step.allFinite()) {
      return ended(GaussNewtonEnd::kNotFinite);
    }
    const double gain = fit.equations.gradient.dot(step);
    if (!(gain > options.min_gain)) {
      return ended(GaussNewtonEnd::kConverged);
    }
    for (int attempt = 1;; ++attempt) {
      State next = move(fit.state, step);
      NormalEquations<N> at_next = evaluate(next);
      if (options.rule == StepRule::kFull || at_next.cost < before) {
        fit.state = std::move(next);
        fit.equations = std::move(at_next);
        break;
      }
      damping *= 10.0;
      if (attempt >= options.max_attempts || damping > options.max_damping) {
        return ended(gain <= options.min_relative_fall * before ? GaussNewtonEnd::kConverged
                                                                : GaussNewtonEnd::kNoDescent);
      }
      step = damping > 0.0 ? DampedStep(fit.equations, damping) : Unknowns<N>(0.5 * step);
    }
    ++fit.iterations;
    damping = damping > 0.0 ? std::max(damping / 10.0, options.min_damping) : 0.0;
    const double fall = options.rule == StepRule::kFull ? gain : before - fit.equations.cost;
    if (fall < options.min_relative_fall * before || settled(step)) {
      return ended(GaussNewtonEnd::kConverged);
    }
  }
  return fit;
}

template <int N, typename State, typename Evaluate, typename Move>
[[nodiscard]] GaussNewtonFit<N, State> MinimizeSquares(const State& start, const Evaluate& evaluate,
                                                       const Move& move,
                                                       const GaussNewtonOptions& options = {}) {
  return MinimizeSquares<N>(start, evaluate, move, options,
                            [](const Unknowns<N>& /*step*/) { return false; });
}

}  // namespace sateen
