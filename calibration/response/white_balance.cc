#include "calibration/response/white_balance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace sateen {
namespace {

constexpr Eigen::Index kGreenIndex = 1;

// Sums of one patch under one light over all its frames, for red and blue.
struct PatchBalance {
  Eigen::Vector3d weight = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();  // sum of weighted logarithms
};

using PatchBalances = std::map<size_t, PatchBalance>;  // [patch], of one light

void Add(const std::array<const PatchSample*, 3>& triple, const Eigen::Vector3d& rho,
         PatchBalance& balance) {
  const PatchSample& green = *triple[kGreenIndex];
  for (const Eigen::Index c : {0, 2}) {
    const PatchSample& own = *triple[static_cast<size_t>(c)];
    const double value =
        std::log(green.signal_dn / own.signal_dn * rho[c] / rho[kGreenIndex]);  // (1)
    const double own_sd = own.sd_dn / own.signal_dn;
    const double green_sd = green.sd_dn / green.signal_dn;
    const double weight = 1.0 / std::max(own_sd * own_sd + green_sd * green_sd, 1e-12);
    balance.weight[c] += weight;
    balance.sum[c] += weight * value;
  }
}

LightBalance MeanOf(const PatchBalances& patches) {
  LightBalance balance{.patches = patches.size()};
  for (const Eigen::Index c : {0, 2}) {
    double weights = 0.0;
    double sum = 0.0;
    for (const auto& [patch, one] : patches) {
      weights += one.weight[c];
      sum += one.sum[c];
    }
    const double mean = sum / weights;
    double scatter = 0.0;  // scatter of the patches about the mean
    for (const auto& [patch, one] : patches) {
      const double off = one.sum[c] / one.weight[c] - mean;
      scatter += one.weight[c] * off * off;
    }
    const double of_noise = 1.0 / weights;
    const double of_patches =
        patches.size() > 1 ? scatter / weights / static_cast<double>(patches.size() - 1) : 0.0;
    balance.white_balance[c] = std::exp(mean);
    balance.sd[c] = std::sqrt(std::max(of_noise, of_patches)) * balance.white_balance[c];
  }
  return balance;
}

}  // namespace

std::vector<std::optional<LightBalance>> BalanceLights(
    const std::vector<PatchSample>& samples, const std::vector<Eigen::Vector3d>& reflectance_rgb,
    size_t lights) {
  std::map<std::pair<size_t, size_t>, std::array<const PatchSample*, 3>> triples;
  for (const PatchSample& sample : samples) {
    triples[{sample.frame, sample.patch}][sample.colour] = &sample;
  }
  std::vector<PatchBalances> patches_of_light(lights);
  for (const auto& [place, triple] : triples) {
    if (std::ranges::all_of(triple, [](const PatchSample* sample) { return sample != nullptr; })) {
      const PatchSample& sample = *triple[0];
      Add(triple, reflectance_rgb[sample.patch], patches_of_light[sample.light][sample.patch]);
    }
  }
  std::vector<std::optional<LightBalance>> balances(lights);
  for (size_t light = 0; light < lights; ++light) {
    if (!patches_of_light[light].empty()) {
      balances[light] = MeanOf(patches_of_light[light]);
    }
  }
  return balances;
}

}  // namespace sateen
