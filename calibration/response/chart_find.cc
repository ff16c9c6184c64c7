#include "calibration/response/chart_find.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/statistics.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr int kPlaces = 9;              // of a patch, along each side
constexpr double kCovered = 0.96;       // of its side
constexpr double kShiftStepMm = 3.0;    // of the grid
constexpr double kTurnStepRad = 0.035;  // two degrees
constexpr double kFinestShiftMm = 0.1;
constexpr int kRefineRounds = 3;  // of refining with coarse steps again, where fine ones got stuck
constexpr double kMostMisfit = 0.33;

struct Place {
  Eigen::Vector2d in_chart_mm;
  double log_reflectance;
};

// Shift along x and y, and turn.
using Candidate = Eigen::Vector3d;

Eigen::Isometry2d PoseOf(const Candidate& candidate) {
  Eigen::Isometry2d pose = Eigen::Isometry2d::Identity();
  pose.translate(Eigen::Vector2d(candidate.head<2>()));
  pose.rotate(candidate[2]);
  return pose;
}

class ChartSearch {
 public:
  ChartSearch(const Image<float>& cells, const Camera& camera, const Light& light,
              const Chart& chart)
      : cells_(cells), camera_(camera), light_(light) {
    for (const ChartPatch& patch : chart.patches) {
      for (int i = 0; i < kPlaces * kPlaces; ++i) {
        const int row = i / kPlaces;
        const Eigen::Vector2d offset((i % kPlaces + 0.5) / kPlaces - 0.5,
                                     (row + 0.5) / kPlaces - 0.5);
        places_.push_back({patch.center_mm + kCovered * chart.patch_mm * offset,
                           std::log(patch.reflectance_rgb.mean())});
      }
    }
    differences_.resize(places_.size());
  }

  // (1)
  double Misfit(const Candidate& candidate) {
    const Eigen::Isometry2d pose = PoseOf(candidate);
    for (size_t j = 0; j < places_.size(); ++j) {
      const Eigen::Vector2d on_table = pose * places_[j].in_chart_mm;
      differences_[j] =
          LogBrightness({on_table.x(), on_table.y(), 0.0}) - places_[j].log_reflectance;
    }
    const double median = Median(differences_);
    double sum = 0.0;
    for (const double difference : differences_) {
      sum += std::min(1.0, std::abs(difference - median));
    }
    return sum / static_cast<double>(differences_.size());
  }

 private:
  // Returns the logarithm of the picture's brightness over that of the light; -100 outside the
  // picture and where either is 0.
  [[nodiscard]] double LogBrightness(const Eigen::Vector3d& point_mm) const {
    constexpr double kNothing = -100.0;
    const Eigen::Vector2d pixel = PixelOfTablePoint(camera_, point_mm);
    const double x = 0.5 * pixel.x() - 0.25;  // in cells
    const double y = 0.5 * pixel.y() - 0.25;
    if (!(x >= 0.0 && x < cells_.width - 1 && y >= 0.0 && y < cells_.height - 1)) {
      return kNothing;
    }
    const Incident in = IncidentAt(light_, point_mm);
    const double brightness = BetweenCells(x, y);
    const double expected = in.e_rgb.mean() * in.l.z();
    return brightness > 0.0 && expected > 0.0 ? std::log(brightness / expected) : kNothing;
  }

  // Interpolates bilinearly, so that (1) falls smoothly towards its minimum.
  [[nodiscard]] double BetweenCells(double x, double y) const {
    const int left = static_cast<int>(x);
    const int top = static_cast<int>(y);
    const auto cell = [&](int dx, int dy) {
      return static_cast<double>(cells_.At(left + dx, top + dy));
    };
    return std::lerp(std::lerp(cell(0, 0), cell(1, 0), x - left),
                     std::lerp(cell(0, 1), cell(1, 1), x - left), y - top);
  }

  const Image<float>& cells_;
  const Camera& camera_;
  const Light& light_;
  std::vector<Place> places_;
  std::vector<double> differences_;
};

// Searches around the best place with steps that are halved until they are fine.
Candidate Refine(ChartSearch& search, Candidate best, double& misfit) {
  double shift_mm = 0.5 * kShiftStepMm;
  double turn_rad = 0.5 * kTurnStepRad;
  while (shift_mm > 0.5 * kFinestShiftMm) {
    Candidate next = best;
    for (int i = 0; i < 27; ++i) {
      const int along_y = i / 3 % 3 - 1;
      const int turned = i / 9 - 1;
      const Candidate candidate =
          best + Candidate((i % 3 - 1) * shift_mm, along_y * shift_mm, turned * turn_rad);
      const double here = search.Misfit(candidate);
      if (here < misfit) {
        misfit = here;
        next = candidate;
      }
    }
    if (next == best) {
      shift_mm *= 0.5;
      turn_rad *= 0.5;
    }
    best = next;
  }
  return best;
}

}  // namespace

Result<ChartPose> FindChart(const Image<float>& cells, const Camera& camera, const Light& light,
                            const Chart& chart, const FindChartOptions& options) {
  if (!(options.max_shift_mm > 0.0 && options.max_shift_mm <= 1000.0)) {
    return Fail(ErrorCode::kInvalidArgument, "max_shift_mm = {:g}; need 0 < max_shift_mm <= 1000",
                options.max_shift_mm);
  }
  if (!(options.max_turn_rad >= 0.0 && options.max_turn_rad <= std::numbers::pi / 4.0)) {
    return Fail(ErrorCode::kInvalidArgument, "max_turn_rad = {:g}; need 0 to pi / 4",
                options.max_turn_rad);
  }
  ChartSearch search(cells, camera, light, chart);
  const int shifts = static_cast<int>(std::ceil(options.max_shift_mm / kShiftStepMm));
  const int turns = static_cast<int>(std::ceil(options.max_turn_rad / kTurnStepRad));
  Candidate best = Candidate::Zero();
  double misfit = std::numeric_limits<double>::infinity();
  for (int quadrant = 0; quadrant < 4; ++quadrant) {
    for (int turn = -turns; turn <= turns; ++turn) {
      for (int x = -shifts; x <= shifts; ++x) {
        for (int y = -shifts; y <= shifts; ++y) {
          const Candidate candidate(x * kShiftStepMm, y * kShiftStepMm,
                                    quadrant * std::numbers::pi / 2.0 + turn * kTurnStepRad);
          const double here = search.Misfit(candidate);
          if (here < misfit) {
            misfit = here;
            best = candidate;
          }
        }
      }
    }
  }
  for (int round = 0; round < kRefineRounds; ++round) {
    best = Refine(search, best, misfit);
  }
  if (misfit > kMostMisfit) {
    return Fail(ErrorCode::kBadData,
                "the chart was not found: at the best place, ({:.0f}, {:.0f}) mm, its patches' "
                "brightness is "
                "off by {:.0f} %; need the chart's middle within {:g} mm of the table's, the whole "
                "chart in "
                "the picture, and its own file of patches",
                best.x(), best.y(), 100.0 * (std::exp(misfit) - 1.0), options.max_shift_mm);
  }
  return ChartPose{PoseOf(best), misfit};
}

}  // namespace sateen
