#pragma once

#include <span>
#include <vector>

namespace sateen {

// Ratio of a normal distribution's standard deviation to the median of its absolute deviations.
inline constexpr double kSdPerMad = 1.4826;

/// Returns the order statistic x_(k) of N values, x_(0) <= x_(1) <= ..., with k = N / 2: the upper
/// one of the two in the middle where N is even. `values` is not empty and has no NaN. O(N).
[[nodiscard]] double Median(std::vector<double> values);
[[nodiscard]] float Median(std::vector<float> values);

/// Returns x_(k) with k = floor(share (N - 1)): the value below which lies at most that share of
/// them, without interpolation. `values` is not empty and has no NaN; 0 <= share <= 1. O(N).
[[nodiscard]] double Quantile(std::vector<double> values, double share);
[[nodiscard]] float Quantile(std::vector<float> values, double share);

/// Interpolates linearly between x_(k) and x_(k + 1) at share (N - 1) = k + fraction. `sorted` is
/// in rising order and not empty; 0 <= share <= 1. O(1).
[[nodiscard]] double InterpolatedQuantile(std::span<const double> sorted, double share);

// Returns the quantile of the normal distribution of mean 0 and variance 1; 0 < share < 1.
[[nodiscard]] double NormalQuantile(double share);

// Returns the quantile of chi squared of `freedom` >= 1 degrees of freedom; 0 <= share < 1.
[[nodiscard]] double ChiSquaredQuantile(double share, int freedom);

}  // namespace sateen
