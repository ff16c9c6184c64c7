#include "solver/rungs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "core/angle.h"
#include "solver/consensus.h"
#include "solver/least_squares.h"
#include "solver/noise.h"

namespace sateen {
namespace {

constexpr float kUnexplainedFactor = 3.0F;
// Where many pixels climb, the model is wrong in what noise hides in the others, too: fully from this
// share on, and not at all where false alarms are as many.
constexpr double kDoubtfulShare = 0.2;
constexpr double kUndoubtedShare = 0.02;

}  // namespace

void PieceSummary::Add(const PieceSummary& other) {
  AddCounts(other.counts, counts);
  least_squares += other.least_squares;
  robust += other.robust;
  sheen += other.sheen;
  unexplained += other.unexplained;
  unchecked += other.unchecked;
  least_squares_deg += other.least_squares_deg;
  robust_deg += other.robust_deg;
  sheen_deg += other.sheen_deg;
  turned_deg += other.turned_deg;
  climbing_seconds += other.climbing_seconds;
  sheen_seconds += other.sheen_seconds;
}

std::array<float, 256> MisfitLimits(double scale_squared, double false_alarms) {
  std::array<float, 256> limits;
  limits.fill(std::numeric_limits<float>::infinity());
  for (size_t usable = 4; usable < limits.size(); ++usable) {
    limits[usable] = static_cast<float>(
        scale_squared * ChiSquaredQuantile(1.0 - false_alarms, static_cast<int>(usable) - 3));
  }
  return limits;
}

std::vector<Eigen::Vector3f> NormalsAt(const NormalField& field, std::span<const size_t> pixels) {
  std::vector<Eigen::Vector3f> normals;
  normals.reserve(pixels.size());
  for (const size_t pixel : pixels) {
    normals.emplace_back(field.normal[0].pixels[pixel], field.normal[1].pixels[pixel],
                         field.normal[2].pixels[pixel]);
  }
  return normals;
}

void JudgeConsensus(std::span<const size_t> pixels, std::span<const Eigen::Vector3f> before,
                    std::span<const uint8_t> agreeing, NormalField& field, PieceSummary& summary) {
  const std::vector<Eigen::Vector3f> after = NormalsAt(field, pixels);
  for (size_t j = 0; j < pixels.size(); ++j) {
    const bool is_explained = agreeing[j] >= kFewestAgreeing;
    const double turned_deg = std::atan2(static_cast<double>(before[j].cross(after[j]).norm()),
                                         static_cast<double>(before[j].dot(after[j]))) *
                              kDegPerRad;
    const double rejected = 1.0 - static_cast<double>(agreeing[j]) /
                                      static_cast<double>(field.samples.pixels[pixels[j]]);
    float& uncertainty = field.uncertainty.pixels[pixels[j]];
    uncertainty = static_cast<float>(
        std::min(180.0, (1.0 + std::max(0.0, rejected)) *
                            std::hypot(static_cast<double>(uncertainty),
                                       static_cast<double>(kUncertaintyOfTurn) * turned_deg)));
    if (!is_explained) {
      uncertainty = std::min(180.0F, uncertainty * kUnexplainedFactor);
      ++summary.unexplained;
    }
    field.model.pixels[pixels[j]] =
        static_cast<uint8_t>(is_explained ? Rung::kConsensus : Rung::kUnexplained);
    summary.turned_deg += turned_deg;
    summary.robust_deg += static_cast<double>(uncertainty);
  }
  summary.robust += static_cast<int64_t>(pixels.size());
}

float Doubt::Of(float uncertainty_deg, Rung rung) const {
  return std::min(
      180.0F, std::hypot(uncertainty_deg, rung == Rung::kUnchecked ? unchecked_deg : checked_deg));
}

Doubt DoubtOf(const PieceSummary& total) {
  const int64_t solved = total.least_squares + total.unchecked + total.robust + total.sheen;
  const double share =
      static_cast<double>(total.robust) / static_cast<double>(std::max<int64_t>(solved, 1));
  const auto doubt = static_cast<float>(
      std::clamp((share - kUndoubtedShare) / (kDoubtfulShare - kUndoubtedShare), 0.0, 1.0));
  const auto turned = static_cast<float>(total.turned_deg /
                                         static_cast<double>(std::max<int64_t>(total.robust, 1)));
  return {doubt * std::hypot(kLeastModelUncertaintyDeg, kUncertaintyOfTurn * turned),
          doubt * std::hypot(kLeastModelUncertaintyDeg, turned)};
}

double SecondsOf(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void ReportRungs(const PieceSummary& total, SolveSummary& summary) {
  const auto mean = [](double sum, int64_t count) {
    return count > 0 ? sum / static_cast<double>(count) : 0.0;
  };
  summary.robust = {total.robust, total.climbing_seconds / std::max(1, summary.threads),
                    mean(total.robust_deg, total.robust)};
  summary.sheen = {total.sheen, total.sheen_seconds / std::max(1, summary.threads),
                   mean(total.sheen_deg, total.sheen)};
  summary.least_squares = {
      total.least_squares + total.unchecked,
      std::max(0.0, summary.seconds - summary.robust.seconds - summary.sheen.seconds),
      mean(total.least_squares_deg, total.least_squares + total.unchecked)};
  summary.turned_deg = mean(total.turned_deg, total.robust);
  summary.unexplained = total.unexplained;
  summary.unchecked = total.unchecked;
}

}  // namespace sateen
