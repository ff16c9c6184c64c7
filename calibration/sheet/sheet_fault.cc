#include "calibration/sheet/sheet_fault.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/linear_algebra.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr double kOffSigmas = 5.0;
constexpr double kLeastShare = 0.004;   // of the sheet's blocks
constexpr double kShareOfLights = 0.2;  // of the lights that see a block
constexpr double kThin = 0.25;          // width over length of a line
constexpr double kLongOfSheet = 0.4;    // length of a line over the sheet's short side
constexpr double kRimBlocks = 0.08;     // of the grid's columns and rows
constexpr double kMostlyRim = 0.6;
constexpr double kInner = 0.05;  // share of the blocks cut off at either end of an extent

// Returns the deviation of each sample in robust standard deviations, the worst of its colours.
std::vector<double> OffsetsOf(const std::vector<SheetSample>& samples, const Light& light,
                              double albedo) {
  std::vector<Eigen::Array3d> off;
  std::vector<double> sizes;
  off.reserve(samples.size());
  for (const SheetSample& sample : samples) {
    const Incident in = IncidentAt(light, sample.point_mm);
    const double shading = albedo * std::max(0.0, sample.normal.dot(in.l));
    off.emplace_back((sample.radiance_rgb - shading * in.e_rgb).array() / sample.sd_rgb.array());
    for (const double one : off.back()) {
      sizes.push_back(std::abs(one));
    }
  }
  if (sizes.empty()) {
    return {};
  }
  const double spread = std::max(kSdPerMad * Quantile(std::move(sizes), 0.5), 1e-12);
  std::vector<double> worst;
  worst.reserve(off.size());
  for (const Eigen::Array3d& one : off) {
    worst.push_back(one.abs().maxCoeff() / spread);
  }
  return worst;
}

// Number of lights per block that see it, and that it deviates from.
struct Votes {
  std::vector<int> seen;
  std::vector<int> off;
  std::vector<Eigen::Vector2d> at_mm;
  std::vector<size_t> off_of_light;

  [[nodiscard]] bool IsFaulty(size_t block) const {
    return off[block] >= 2 && off[block] >= kShareOfLights * seen[block];
  }
};

Votes Count(const SheetReadings& sheet, const Lights& lights, double albedo) {
  const size_t count = static_cast<size_t>(sheet.columns) * static_cast<size_t>(sheet.rows);
  Votes votes{std::vector<int>(count, 0), std::vector<int>(count, 0),
              std::vector<Eigen::Vector2d>(count, Eigen::Vector2d::Zero()),
              std::vector<size_t>(lights.size(), 0)};
  for (size_t k = 0; k < lights.size(); ++k) {
    const std::vector<double> offsets = OffsetsOf(sheet.samples[k], lights[k], albedo);
    for (size_t i = 0; i < offsets.size(); ++i) {
      const auto block = static_cast<size_t>(sheet.blocks[k][i]);
      ++votes.seen[block];
      votes.at_mm[block] = sheet.samples[k][i].point_mm.head<2>();
      if (offsets[i] > kOffSigmas) {
        ++votes.off[block];
        ++votes.off_of_light[k];
      }
    }
  }
  return votes;
}

// Returns length along the principal axis and width across it, of nine tenths of the points.
Eigen::Vector2d ExtentOf(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points) {
    mean += point / static_cast<double>(points.size());
  }
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& point : points) {
    spread += (point - mean) * (point - mean).transpose();
  }
  const SymmetricEigen axes = DecomposeSymmetric(spread);
  Eigen::Vector2d extent;
  for (const Eigen::Index axis : {0, 1}) {
    std::vector<double> along;
    along.reserve(points.size());
    for (const Eigen::Vector2d& point : points) {
      along.push_back(axes.vectors.col(1 - axis).dot(point));  // the longer first
    }
    extent[axis] = Quantile(along, 1.0 - kInner) - Quantile(along, kInner);
  }
  return extent;
}

bool IsAtRim(int block, int columns, int rows) {
  const int column = block % columns;
  const int row = block / columns;
  return std::min(column, columns - 1 - column) < kRimBlocks * columns ||
         std::min(row, rows - 1 - row) < kRimBlocks * rows;
}

}  // namespace

std::optional<SheetFault> FindSheetFault(const SheetReadings& sheet, const Lights& lights,
                                         double albedo) {
  const Votes votes = Count(sheet, lights, albedo);
  std::vector<Eigen::Vector2d> faulty;
  std::vector<Eigen::Vector2d> all;
  size_t at_rim = 0;
  for (int block = 0; block < sheet.columns * sheet.rows; ++block) {
    const auto at = static_cast<size_t>(block);
    if (votes.seen[at] == 0) {
      continue;
    }
    all.push_back(votes.at_mm[at]);
    if (votes.IsFaulty(at)) {
      faulty.push_back(votes.at_mm[at]);
      at_rim += IsAtRim(block, sheet.columns, sheet.rows) ? 1 : 0;
    }
  }
  if (static_cast<double>(faulty.size()) <
      std::max(2.0, kLeastShare * static_cast<double>(all.size()))) {
    return std::nullopt;
  }
  const auto count = static_cast<double>(faulty.size());
  SheetFault fault{.share = count / static_cast<double>(all.size())};
  for (const Eigen::Vector2d& point : faulty) {
    fault.center_mm += point / count;
  }
  const Eigen::Vector2d extent = ExtentOf(faulty);
  fault.length_mm = extent[0];
  fault.width_mm = extent[1];
  if (static_cast<double>(at_rim) > kMostlyRim * count) {
    fault.shape = FaultShape::kRim;
  } else if (extent[1] < kThin * extent[0] && extent[0] > kLongOfSheet * ExtentOf(all)[1]) {
    fault.shape = FaultShape::kLine;
  }
  fault.worst_light = static_cast<size_t>(std::ranges::max_element(votes.off_of_light) -
                                          votes.off_of_light.begin());
  return fault;
}

}  // namespace sateen
