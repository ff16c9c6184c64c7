#include "core/statistics.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <cstddef>

#include "core/check.h"

namespace sateen {
namespace {

template <typename T>
T OrderStatistic(std::vector<T>& values, size_t k) {
  SATEEN_CHECK(k < values.size());
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(k);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

template <typename T>
size_t PlaceOf(const std::vector<T>& values, double share) {
  SATEEN_CHECK(!values.empty() && share >= 0.0 && share <= 1.0);
  return static_cast<size_t>(share * static_cast<double>(values.size() - 1));
}

}  // namespace

double Median(std::vector<double> values) { return OrderStatistic(values, values.size() / 2); }

float Median(std::vector<float> values) { return OrderStatistic(values, values.size() / 2); }

double Quantile(std::vector<double> values, double share) {
  return OrderStatistic(values, PlaceOf(values, share));
}

float Quantile(std::vector<float> values, double share) {
  return OrderStatistic(values, PlaceOf(values, share));
}

double InterpolatedQuantile(std::span<const double> sorted, double share) {
  SATEEN_CHECK(!sorted.empty() && share >= 0.0 && share <= 1.0);
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

double NormalQuantile(double share) {
  SATEEN_CHECK(share > 0.0 && share < 1.0);
  return boost::math::quantile(boost::math::normal(), share);
}

double ChiSquaredQuantile(double share, int freedom) {
  SATEEN_CHECK(share >= 0.0 && share < 1.0 && freedom >= 1);
  return boost::math::quantile(boost::math::chi_squared(freedom), share);
}

}  // namespace sateen
