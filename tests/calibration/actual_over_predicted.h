#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>

namespace sateen::testing {

// Root mean square of errors over their standard deviations: 1 where these are honest.
class ActualOverPredicted {
 public:
  void Add(double error, double sd) { AddSquare(error * error / (sd * sd), 1.0); }

  // Errors of several unknowns with their covariance.
  void Add(const Eigen::VectorXd& errors, const Eigen::MatrixXd& covariance) {
    AddSquare(errors.dot(covariance.ldlt().solve(errors)), static_cast<double>(errors.size()));
  }

  [[nodiscard]] double Ratio() const { return std::sqrt(squares_ / count_); }

 private:
  void AddSquare(double square, double count) {
    squares_ += square;
    count_ += count;
  }

  double squares_ = 0.0;
  double count_ = 0.0;
};

}  // namespace sateen::testing
