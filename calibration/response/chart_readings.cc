#include "calibration/response/chart_readings.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/linear_algebra.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr double kCutShare = 0.1;

struct SiteMoments {
  double mean = 0.0;
  double variance = 0.0;
  double top = 0.0;
  double count = 0.0;
};

std::array<SiteMoments, 3> MomentsOf(const PatchSites& sites, const std::vector<uint16_t>& dn) {
  std::array<SiteMoments, 3> moments;
  for (size_t i = 0; i < dn.size(); ++i) {
    SiteMoments& m = moments[sites.colour[i]];
    m.mean += dn[i];
    m.count += 1.0;
    m.top = std::max(m.top, static_cast<double>(dn[i]));
  }
  for (SiteMoments& m : moments) {
    m.mean /= m.count;
  }
  for (size_t i = 0; i < dn.size(); ++i) {
    SiteMoments& m = moments[sites.colour[i]];
    m.variance += (dn[i] - m.mean) * (dn[i] - m.mean) / (m.count - 1.0);
  }
  return moments;
}

// Dark level of one patch and colour over exposure time: a + b t.
struct DarkLine {
  double a = 0.0;
  double b = 0.0;
};

struct DarkReading {
  double exposure_s = 0.0;
  double mean_dn = 0.0;
};

DarkLine LineThrough(const std::vector<DarkReading>& dark) {
  double time = 0.0;
  double mean = 0.0;
  const auto count = static_cast<double>(dark.size());
  for (const DarkReading& one : dark) {
    time += one.exposure_s / count;
    mean += one.mean_dn / count;
  }
  double products = 0.0;
  double squares = 0.0;
  for (const DarkReading& one : dark) {
    products += (one.exposure_s - time) * (one.mean_dn - mean);
    squares += (one.exposure_s - time) * (one.exposure_s - time);
  }
  const double slope = squares > 0.0 ? products / squares : 0.0;
  return {squares > 0.0 ? mean - slope * time : mean, slope};
}

double ShareOfZeros(const ChartFrame& frame) {
  double zeros = 0.0;
  double count = 0.0;
  for (const std::vector<uint16_t>& patch : frame.dn) {
    zeros += static_cast<double>(std::ranges::count(patch, uint16_t{0}));
    count += static_cast<double>(patch.size());
  }
  return zeros / count;
}

std::vector<std::array<DarkLine, 3>> DarkLinesOf(const ChartReadings& readings, DarkLevel& dark) {
  std::vector<std::array<std::vector<DarkReading>, 3>> means(readings.patches.size());
  dark = {};
  for (const ChartFrame& frame : readings.frames) {
    if (frame.light) {
      continue;
    }
    dark.is_cut = dark.is_cut || ShareOfZeros(frame) > kCutShare;
    for (size_t patch = 0; patch < means.size(); ++patch) {
      const auto moments = MomentsOf(readings.patches[patch], frame.dn[patch]);
      for (size_t c = 0; c < 3; ++c) {
        means[patch][c].push_back({frame.exposure_s, moments[c].mean});
      }
    }
  }
  std::vector<std::array<DarkLine, 3>> lines(means.size());
  for (size_t patch = 0; patch < means.size(); ++patch) {
    for (size_t c = 0; c < 3; ++c) {
      lines[patch][c] = LineThrough(means[patch][c]);
      dark.black_dn += lines[patch][c].a / (3.0 * static_cast<double>(means.size()));
    }
  }
  return lines;
}

}  // namespace

std::vector<PatchSample> SamplesOf(const ChartReadings& readings, DarkLevel& dark) {
  const std::vector<std::array<DarkLine, 3>> lines = DarkLinesOf(readings, dark);
  std::vector<PatchSample> samples;
  for (size_t f = 0; f < readings.frames.size(); ++f) {
    const ChartFrame& frame = readings.frames[f];
    if (!frame.light) {
      continue;
    }
    for (size_t patch = 0; patch < readings.patches.size(); ++patch) {
      const auto moments = MomentsOf(readings.patches[patch], frame.dn[patch]);
      for (size_t c = 0; c < 3; ++c) {
        const double black = lines[patch][c].a + lines[patch][c].b * frame.exposure_s;
        samples.push_back({.frame = f,
                           .light = *frame.light,
                           .patch = patch,
                           .colour = c,
                           .exposure_s = frame.exposure_s,
                           .signal_dn = moments[c].mean - black,
                           .sd_dn = std::sqrt(moments[c].variance / moments[c].count),
                           .top_dn = moments[c].top,
                           .black_dn = black});
      }
    }
  }
  return samples;
}

double UnevennessOf(const PatchSites& sites, const std::vector<uint16_t>& dn, double black_dn) {
  constexpr uint8_t kGreen = 1;
  constexpr size_t kBlocksAlong = kPatchBlocks;
  constexpr size_t kParts = kBlocksAlong * kBlocksAlong;
  std::array<SiteMoments, kParts> parts;
  for (size_t i = 0; i < dn.size(); ++i) {
    if (sites.colour[i] == kGreen) {
      parts[sites.block[i]].mean += dn[i] - black_dn;
      parts[sites.block[i]].count += 1.0;
    }
  }
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  const auto place = [](size_t part) {
    return Eigen::Vector3d(
        1.0, static_cast<double>(part % kBlocksAlong),
        std::floor(static_cast<double>(part) / static_cast<double>(kBlocksAlong)));
  };
  double mean = 0.0;
  double filled = 0.0;
  for (size_t part = 0; part < kParts; ++part) {
    if (parts[part].count > 0.0) {
      parts[part].mean /= parts[part].count;
      normal += place(part) * place(part).transpose();
      right += place(part) * parts[part].mean;
      mean += parts[part].mean;
      filled += 1.0;
    }
  }
  const Eigen::Vector3d plane = SolveSymmetric(normal, right);
  double largest = 0.0;
  std::vector<double> misfits;
  for (size_t part = 0; part < kParts; ++part) {
    if (parts[part].count > 0.0) {
      misfits.push_back(std::abs(parts[part].mean - plane.dot(place(part))));
      largest = std::max(largest, misfits.back());
    }
  }
  // The median of |deviations| is 0.674 standard deviations. A speck of dust does not change it.
  const double sd = Median(std::move(misfits)) / 0.674;
  return std::max(0.0, (largest - 5.0 * sd) / std::max(mean / filled, 1e-9));
}

}  // namespace sateen
