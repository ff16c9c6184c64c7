#include "solver/robust/rungs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/angle.h"
#include "core/stopwatch.h"
#include "solver/least_squares/least_squares.h"
#include "solver/noise.h"
#include "solver/robust/consensus.h"

namespace sateen {
namespace {

constexpr double kUnexplainedFactor = 3.0;
// Uncertainty without an answer: the root mean square angle of a hemisphere's normals to its
// middle.
constexpr float kAnyNormalDeg = 60.0F;
// Shares of climbing pixels from which the model counts as wholly wrong for the others, too, and up
// to which it does not count as wrong: false alarms are as many.
constexpr double kDoubtfulShare = 0.2;
constexpr double kUndoubtedShare = 0.02;

struct Difference {
  double turned_deg;
  double albedo;  // relative to the second, at most 1
};

Difference DifferenceOf(const Estimate& a, const Estimate& b) {
  const double turned_deg = AngleBetweenRad(a.n, b.n) * kDegPerRad;
  const double change = std::abs(static_cast<double>(a.albedo / b.albedo) - 1.0);
  return {turned_deg, change <= 1.0 ? change : 1.0};
}

}  // namespace

void PieceSummary::Add(const PieceSummary& other) {
  AddCounts(other.counts, counts);
  least_squares += other.least_squares;
  robust += other.robust;
  lobe += other.lobe;
  unexplained += other.unexplained;
  unchecked += other.unchecked;
  least_squares_deg += other.least_squares_deg;
  robust_deg += other.robust_deg;
  lobe_deg += other.lobe_deg;
  turned_deg += other.turned_deg;
  albedo_change += other.albedo_change;
  climbing_seconds += other.climbing_seconds;
  lobe_seconds += other.lobe_seconds;
}

std::array<float, 256> MisfitLimits(double scale_squared, double false_alarms) {
  std::array<float, 256> limits;
  limits.fill(std::numeric_limits<float>::infinity());
  for (size_t usable = 4; usable < limits.size(); ++usable) {
    limits[usable] =
        static_cast<float>(scale_squared * ReducedChiSquaredQuantile(1.0 - false_alarms,
                                                                     static_cast<int>(usable) - 3));
  }
  return limits;
}

std::vector<Estimate> EstimatesAt(const NormalField& field, std::span<const size_t> pixels,
                                  const std::function<float(size_t)>& albedo) {
  std::vector<Estimate> estimates;
  estimates.reserve(pixels.size());
  for (const size_t pixel : pixels) {
    const Eigen::Vector3f n(field.normal[0].pixels[pixel], field.normal[1].pixels[pixel],
                            field.normal[2].pixels[pixel]);
    estimates.push_back({n, albedo(pixel)});
  }
  return estimates;
}

void JudgeConsensus(std::span<const size_t> pixels, std::span<const Estimate> before,
                    std::span<const Estimate> after, std::span<const uint8_t> agreeing,
                    NormalField& field, PieceSummary& summary) {
  for (size_t j = 0; j < pixels.size(); ++j) {
    const bool is_explained = agreeing[j] >= kFewestAgreeing;
    const auto [turned_deg, change] = DifferenceOf(before[j], after[j]);
    const auto albedo = static_cast<double>(after[j].albedo);
    const double rejected = 1.0 - static_cast<double>(agreeing[j]) /
                                      static_cast<double>(field.samples.pixels[pixels[j]]);
    const double factor =
        (1.0 + std::max(0.0, rejected)) * (is_explained ? 1.0 : kUnexplainedFactor);
    const double of_gloss = albedo > 0.0 ? kGlossInAlbedo / albedo : 1.0;
    const auto doubt = [&](float of_spread, double difference) {
      return static_cast<float>(factor *
                                std::hypot(static_cast<double>(of_spread),
                                           static_cast<double>(kUncertaintyOfTurn) * difference));
    };
    float& uncertainty = field.uncertainty.pixels[pixels[j]];
    uncertainty = std::min(180.0F, doubt(uncertainty, turned_deg));
    float& of_albedo = field.albedo_uncertainty.pixels[pixels[j]];
    of_albedo = std::min(1.0F, std::hypot(doubt(of_albedo, change), static_cast<float>(of_gloss)));
    if (agreeing[j] == 0) {
      uncertainty = std::max(uncertainty, kAnyNormalDeg);
      of_albedo = 1.0F;
    }
    summary.unexplained += is_explained ? 0 : 1;
    field.model.pixels[pixels[j]] =
        static_cast<uint8_t>(is_explained ? Rung::kConsensus : Rung::kUnexplained);
    summary.turned_deg += turned_deg;
    summary.albedo_change += change;
    summary.robust_deg += static_cast<double>(uncertainty);
  }
  summary.robust += static_cast<int64_t>(pixels.size());
}

void Doubt::AddTo(NormalField& field, size_t pixel) const {
  const bool checked = field.model.pixels[pixel] != static_cast<uint8_t>(Rung::kUnchecked);
  float& uncertainty = field.uncertainty.pixels[pixel];
  uncertainty = std::min(180.0F, std::hypot(uncertainty, checked ? checked_deg : unchecked_deg));
  float& of_albedo = field.albedo_uncertainty.pixels[pixel];
  of_albedo = std::min(1.0F, std::hypot(of_albedo, checked ? checked_albedo : unchecked_albedo));
}

Doubt DoubtOf(const PieceSummary& total) {
  const int64_t solved = total.least_squares + total.unchecked + total.robust + total.lobe;
  const double share =
      static_cast<double>(total.robust) / static_cast<double>(std::max<int64_t>(solved, 1));
  const auto doubt = static_cast<float>(
      std::clamp((share - kUndoubtedShare) / (kDoubtfulShare - kUndoubtedShare), 0.0, 1.0));
  const auto climbed = static_cast<double>(std::max<int64_t>(total.robust, 1));
  const auto turned = static_cast<float>(total.turned_deg / climbed);
  const auto change = static_cast<float>(total.albedo_change / climbed);
  constexpr auto kLeastDeg = kLeastModelUncertainty * static_cast<float>(kDegPerRad);
  return {doubt * std::hypot(kLeastDeg, kUncertaintyOfTurn * turned),
          doubt * std::hypot(kLeastModelUncertainty, kUncertaintyOfTurn * change),
          doubt * std::hypot(kLeastDeg, turned),
          doubt * std::hypot(kLeastModelUncertainty, change)};
}

bool TakesLobe(const LobeAnswer& answer, float albedo_of_lobe, double share,
               double misfit_of_rung_1, const Estimate& of_rung_1, NormalField& field,
               size_t pixel) {
  const double likely =
      LobeProbability(misfit_of_rung_1, answer.misfit, field.samples.pixels[pixel] - 3, share);
  const bool takes = likely >= 0.5;
  const Eigen::Vector3f n = answer.n.normalized().cast<float>();
  float& uncertainty = field.uncertainty.pixels[pixel];
  float& of_albedo = field.albedo_uncertainty.pixels[pixel];
  if (takes) {
    for (size_t c = 0; c < 3; ++c) {
      field.normal[c].pixels[pixel] = n[static_cast<Eigen::Index>(c)];
    }
    field.residual.pixels[pixel] = static_cast<float>(answer.residual);
    field.model.pixels[pixel] = static_cast<uint8_t>(Rung::kLobe);
    uncertainty =
        static_cast<float>(std::hypot(answer.uncertainty_deg, kLobeUncertainty * kDegPerRad));
    of_albedo = static_cast<float>(std::hypot(answer.albedo_uncertainty, kLobeUncertainty,
                                              kUncertaintyOfLobe * answer.lobe_share));
  }
  const double of_other = std::sqrt(takes ? 1.0 - likely : likely);
  const Difference difference = DifferenceOf(of_rung_1, {n, albedo_of_lobe});
  uncertainty = std::min(
      180.0F, std::hypot(uncertainty, static_cast<float>(of_other * difference.turned_deg)));
  of_albedo =
      std::min(1.0F, std::hypot(of_albedo, static_cast<float>(of_other * difference.albedo)));
  return takes;
}

double SecondsOf(const std::function<void()>& work) {
  const Stopwatch stopwatch;
  work();
  return stopwatch.Seconds();
}

void ReportRungs(const PieceSummary& total, SolveSummary& summary) {
  const auto mean = [](double sum, int64_t count) {
    return count > 0 ? sum / static_cast<double>(count) : 0.0;
  };
  summary.robust = {total.robust, total.climbing_seconds / std::max(1, summary.threads),
                    mean(total.robust_deg, total.robust)};
  summary.under_lobe = {total.lobe, total.lobe_seconds / std::max(1, summary.threads),
                        mean(total.lobe_deg, total.lobe)};
  summary.least_squares = {
      total.least_squares + total.unchecked,
      std::max(0.0, summary.seconds - summary.robust.seconds - summary.under_lobe.seconds),
      mean(total.least_squares_deg, total.least_squares + total.unchecked)};
  summary.turned_deg = mean(total.turned_deg, total.robust);
  summary.unexplained = total.unexplained;
  summary.unchecked = total.unchecked;
}

}  // namespace sateen
