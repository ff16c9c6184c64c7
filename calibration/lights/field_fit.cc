#include "calibration/lights/field_fit.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "calibration/fit/robust_spread.h"
#include "calibration/lights/light_residuals.h"
#include "core/linear_algebra.h"

namespace sateen {
namespace {

constexpr int kWeightedRounds = 10;   // of Cauchy's weights
constexpr int kAdmissions = 3;        // of what lies within, after squares are fitted
constexpr double kAsGood = 1.01;      // times the least held-out error
constexpr double kWeightScale = 2.0;  // of the residuals' spread
constexpr double kLeastGain = 1e-3;
constexpr double kLeastVariance = 1e-24;
constexpr double kConvergedMm = 1e-5;
constexpr double kReferenceMm2 = 1e6;       // where flux is irradiance, squared
constexpr double kLeastRoughness = 100.0;   // second differences of 0.1: rougher than any lens
constexpr int kRoughnessTrials = 6;         // each ten times the last
constexpr Eigen::Index kLightUnknowns = 6;  // position, log flux; then the gains

// A grid of gains of 1 under all the rays that meet the samples.
GainField GridUnder(const std::vector<SheetSample>& samples, const Light& led, double spacing_mm) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector2d at = ShadowOnTable(led.position_mm, sample.point_mm);
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  const Eigen::Array2d extent_mm = (high - low).array();
  // No more knots than the rig's file may hold, however far the sheets reach.
  const double spacing = std::max(spacing_mm, extent_mm.maxCoeff() / (kMostFieldKnots - 3));
  const Eigen::Array2d intervals = (extent_mm / spacing).ceil().max(1.0);
  const Eigen::Vector2d slack = 0.5 * (intervals * spacing - extent_mm).matrix();
  GainField field{.origin_mm = low - slack - Eigen::Vector2d::Constant(spacing),
                  .spacing_mm = spacing,
                  .columns = static_cast<int>(intervals.x()) + 3,
                  .rows = static_cast<int>(intervals.y()) + 3};
  field.gain.assign(static_cast<size_t>(field.columns) * static_cast<size_t>(field.rows), 1.0);
  return field;
}

// What (1) leaves and how it changes with the unknowns: J = a_c [q; g e_c; B] for channel c.
struct Linearised {
  Eigen::Array3d a;
  Eigen::Vector3d q;
  double g = 1.0;
  GainField::Weights b;
};

class FieldFitter {
 public:
  FieldFitter(const std::vector<SheetSample>& samples, const Light& ruler,
              const FieldFitOptions& options)
      : samples_(samples),
        residuals_(samples, options.albedo),
        options_(options),
        light_(ruler),
        ruler_mm_(ruler.position_mm) {
    light_.model = LightModel::kLedField;
    light_.field = GridUnder(samples, ruler, options.spacing_mm);
    size_ = kLightUnknowns + static_cast<Eigen::Index>(light_.field.gain.size());
  }

  [[nodiscard]] const Light& Current() const { return light_; }
  [[nodiscard]] int Iterations() const { return iterations_; }

  [[nodiscard]] std::vector<double> Residuals(const std::vector<size_t>& indices) const {
    return residuals_.Of(light_, indices);
  }

  // v of (2): from how neighbours differ, so that a model that is still wrong does not stiffen itself.
  [[nodiscard]] double Variance(const std::vector<size_t>& indices) const {
    const double noise = residuals_.NoiseRms(light_, indices);
    return std::max(noise * noise, kLeastVariance);
  }

  // Cauchy's weights, as wide as the residuals then are.
  void DescendWeighted(const std::vector<size_t>& indices, double roughness) {
    for (int round = 0; round < kWeightedRounds; ++round) {
      const std::vector<double> r = Residuals(indices);
      const double spread = SpreadOf(r);
      std::vector<double> weights(indices.size());
      for (size_t i = 0; i < weights.size(); ++i) {
        const double squared =
            r[3 * i] * r[3 * i] + r[3 * i + 1] * r[3 * i + 1] + r[3 * i + 2] * r[3 * i + 2];
        weights[i] = 1.0 / (1.0 + squared / std::pow(kWeightScale * spread, 2));
      }
      Assemble(indices, r, weights);
      Step(roughness, Variance(indices));
    }
  }

  void DescendSquares(const std::vector<size_t>& indices, double roughness) {
    for (int step = 0; step < options_.most_iterations; ++step) {
      const std::vector<double> r = Residuals(indices);
      Assemble(indices, r, std::vector<double>(indices.size(), 1.0));
      if (Step(roughness, Variance(indices)) < kConvergedMm) {
        break;
      }
    }
  }

  // The largest roughness weight whose next step explains the held-out samples as well as any; takes
  // none of them.
  [[nodiscard]] double BestRoughness(const std::vector<size_t>& indices,
                                     const std::vector<size_t>& held_out) {
    const std::vector<double> r = Residuals(indices);
    const double variance = Variance(indices);
    Assemble(indices, r, std::vector<double>(indices.size(), 1.0));
    const Light start = light_;
    std::vector<std::pair<double, double>> tried;
    double least = std::numeric_limits<double>::infinity();
    for (int trial = 0; trial < kRoughnessTrials; ++trial) {
      const double roughness = kLeastRoughness * std::pow(10.0, trial);
      Step(roughness, variance);
      const std::vector<double> off = Residuals(held_out);
      tried.emplace_back(roughness,
                         Rms(residuals_.Of(light_, OnModel(held_out, off, SpreadOf(off)))));
      least = std::min(least, tried.back().second);
      light_ = start;
    }
    double best = kLeastRoughness;
    for (const auto& [roughness, rms] : tried) {
      best = rms <= kAsGood * least ? roughness : best;
    }
    return best;
  }

  // Gives flux what it shares with the gain, and returns the covariance of position and log flux.
  Eigen::MatrixXd Normalise(const std::vector<size_t>& used, double roughness) {
    const std::vector<double> r = Residuals(used);
    Assemble(used, r, std::vector<double>(used.size(), 1.0));
    AddPenalty(roughness, Variance(used));
    Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(size_, kLightUnknowns);
    shares.topRows(kLightUnknowns).setIdentity();
    double mean = 0.0;
    for (const size_t index : used) {
      const Linearised at = Linearise(samples_[index]);
      mean += at.g / static_cast<double>(used.size());
      for (size_t i = 0; i < 16; ++i) {
        shares.row(GainUnknown(at.b, i)).tail<3>().array() +=
            at.b.value[i] / static_cast<double>(used.size());
      }
    }
    shares.bottomRows(size_ - kLightUnknowns) /= mean;
    light_.flux_rgb *= mean;
    for (double& gain : light_.field.gain) {
      gain = std::max(gain / mean, kLeastGain);
    }
    return shares.transpose() * SolveSymmetric(normal_, shares);
  }

 private:
  [[nodiscard]] Eigen::Index GainUnknown(const GainField::Weights& weights, size_t i) const {
    const size_t columns = static_cast<size_t>(light_.field.columns);
    return kLightUnknowns + static_cast<Eigen::Index>(weights.first + (i / 4) * columns + i % 4);
  }

  [[nodiscard]] Linearised Linearise(const SheetSample& sample) const {
    const SheetShading shading = ShadingOf(sample, light_);
    const TableShadow shadow = ShadowOf(sample, light_);
    Linearised at{.b = light_.field.WeightsAt(shadow.at_mm)};
    at.a = options_.albedo * shading.value * light_.flux_rgb.array() / sample.sd_rgb.array();
    at.g = 0.0;
    Eigen::RowVector2d slope = Eigen::RowVector2d::Zero();
    for (size_t i = 0; i < 16; ++i) {
      const double gain =
          light_.field.gain[static_cast<size_t>(GainUnknown(at.b, i) - kLightUnknowns)];
      at.g += gain * at.b.value[i];
      slope += gain * Eigen::RowVector2d(at.b.along_x[i], at.b.along_y[i]);
    }
    at.q = (slope * shadow.by_position).transpose();
    if (shading.value > 0.0) {
      at.q += at.g * shading.by_position / shading.value;
    }
    return at;
  }

  // normal_ = J^T W J, gradient_ = J^T W r.
  void Assemble(const std::vector<size_t>& indices, const std::vector<double>& r,
                const std::vector<double>& weights) {
    normal_ = Eigen::MatrixXd::Zero(size_, size_);
    gradient_ = Eigen::VectorXd::Zero(size_);
    for (size_t i = 0; i < indices.size(); ++i) {
      const Linearised at = Linearise(samples_[indices[i]]);
      // The unknowns that the sample depends on, but for log flux, which differs by channel.
      Eigen::Matrix<double, 19, 1> row;
      std::array<Eigen::Index, 19> place;
      for (Eigen::Index s = 0; s < 3; ++s) {
        row[s] = at.q[s];
        place[static_cast<size_t>(s)] = s;
      }
      for (size_t k = 0; k < 16; ++k) {
        row[static_cast<Eigen::Index>(3 + k)] = at.b.value[k];
        place[3 + k] = GainUnknown(at.b, k);
      }
      const Eigen::Array3d aa = weights[i] * at.a.square();
      const Eigen::Array3d ar =
          weights[i] * at.a * Eigen::Array3d(r[3 * i], r[3 * i + 1], r[3 * i + 2]);
      for (Eigen::Index m = 0; m < 19; ++m) {
        const Eigen::Index to = place[static_cast<size_t>(m)];
        gradient_[to] += ar.sum() * row[m];
        const double scaled = aa.sum() * row[m];
        for (Eigen::Index n = 0; n < 19; ++n) {
          normal_(place[static_cast<size_t>(n)], to) += scaled * row[n];
        }
        for (Eigen::Index c = 0; c < 3; ++c) {
          normal_(3 + c, to) += aa[c] * at.g * row[m];
          normal_(to, 3 + c) += aa[c] * at.g * row[m];
        }
      }
      for (Eigen::Index c = 0; c < 3; ++c) {
        normal_(3 + c, 3 + c) += aa[c] * at.g * at.g;
        gradient_[3 + c] += ar[c] * at.g;
      }
    }
  }

  // Adds the second term of (2) and its gradient at the current gains.
  void AddPenalty(double roughness, double variance) {
    const GainField& field = light_.field;
    const auto add = [&](size_t middle, size_t stride) {
      const std::array<size_t, 3> knots = {middle - stride, middle, middle + stride};
      const std::array<double, 3> difference = {1.0, -2.0, 1.0};
      double value = 0.0;
      for (size_t i = 0; i < 3; ++i) {
        value += difference[i] * field.gain[knots[i]];
      }
      for (size_t i = 0; i < 3; ++i) {
        const auto at_i = kLightUnknowns + static_cast<Eigen::Index>(knots[i]);
        gradient_[at_i] += variance * roughness * difference[i] * value;
        for (size_t j = 0; j < 3; ++j) {
          normal_(at_i, kLightUnknowns + static_cast<Eigen::Index>(knots[j])) +=
              variance * roughness * difference[i] * difference[j];
        }
      }
    };
    const auto columns = static_cast<size_t>(field.columns);
    const auto rows = static_cast<size_t>(field.rows);
    const double tie =
        variance / (options_.gain_sd * options_.gain_sd * static_cast<double>(field.gain.size()));
    for (size_t knot = 0; knot < field.gain.size(); ++knot) {
      const size_t column = knot % columns;
      const size_t row = knot / columns;
      if (column > 0 && column + 1 < columns) {
        add(knot, 1);
      }
      if (row > 0 && row + 1 < rows) {
        add(knot, columns);
      }
      const auto at = kLightUnknowns + static_cast<Eigen::Index>(knot);
      normal_(at, at) += tie;
      gradient_[at] += tie * (field.gain[knot] - 1.0);
    }
    const double hold = variance / (options_.position_sd_mm * options_.position_sd_mm);
    normal_.diagonal().head<3>().array() += hold;
    gradient_.head<3>() += hold * (light_.position_mm - ruler_mm_);
  }

  // One step of Gauss and Newton's method from what was assembled, which stays as it is; returns how far
  // the light moved.
  double Step(double roughness, double variance) {
    const Eigen::MatrixXd normal = normal_;
    const Eigen::VectorXd gradient = gradient_;
    AddPenalty(roughness, variance);
    const Eigen::VectorXd change = -SolveSymmetric(normal_, gradient_);
    normal_ = normal;
    gradient_ = gradient;
    ++iterations_;
    light_.position_mm += change.head<3>();
    light_.flux_rgb.array() *= change.segment<3>(3).array().exp();
    for (size_t knot = 0; knot < light_.field.gain.size(); ++knot) {
      double& gain = light_.field.gain[knot];
      gain = std::max(gain + change[kLightUnknowns + static_cast<Eigen::Index>(knot)], kLeastGain);
    }
    return change.head<3>().norm();
  }

  const std::vector<SheetSample>& samples_;
  LightResiduals residuals_;
  const FieldFitOptions& options_;
  Light light_;
  Eigen::Vector3d ruler_mm_;
  Eigen::Index size_ = 0;
  int iterations_ = 0;
  Eigen::MatrixXd normal_;
  Eigen::VectorXd gradient_;
};

Status CheckField(const Light& light) {
  if (!(light.position_mm.allFinite() && light.position_mm.z() > 0.0 &&
        light.flux_rgb.allFinite())) {
    return Fail(ErrorCode::kDegenerate,
                "the fit of the led+field model ran away; add tilted sheets");
  }
  return light.field.Validate("the fit of the led+field model");
}

}  // namespace

Status FieldFitOptions::Validate() const {
  const auto fail = [](std::string_view field, double value, std::string_view range) {
    return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", field, value, range);
  };
  if (!(albedo > 0.0 && albedo <= 1.0)) {
    return fail("albedo", albedo, "0 < albedo <= 1");
  }
  if (!(spacing_mm > 0.0 && std::isfinite(spacing_mm))) {
    return fail("spacing_mm", spacing_mm, "a number > 0");
  }
  if (!(gain_sd > 0.0 && std::isfinite(gain_sd))) {
    return fail("gain_sd", gain_sd, "a number > 0");
  }
  if (!(position_sd_mm > 0.0 && std::isfinite(position_sd_mm))) {
    return fail("position_sd_mm", position_sd_mm, "a number > 0");
  }
  if (most_iterations < 1) {
    return fail("most_iterations", most_iterations, "1 or more");
  }
  return {};
}

SheetShading ShadingOf(const SheetSample& sample, const Light& led) {
  const Eigen::Vector3d d = led.position_mm - sample.point_mm;
  const double distance = d.norm();
  const double facing = sample.normal.dot(d);
  const double along = led.axis.dot(d);  // < 0 before the LED
  if (!(facing > 0.0 && along < 0.0)) {
    return {};
  }
  SheetShading shading;
  shading.value = kReferenceMm2 * facing / (distance * distance * distance) *
                  std::pow(-along / distance, led.anisotropy);
  // Of the logarithm: facing, the cube of the distance, the cosine to the axis.
  shading.by_position =
      shading.value * (sample.normal / facing + led.anisotropy * led.axis / along -
                       (3.0 + led.anisotropy) * d / (distance * distance));
  return shading;
}

TableShadow ShadowOf(const SheetSample& sample, const Light& led) {
  const Eigen::Vector3d& s = led.position_mm;
  const Eigen::Vector3d& x = sample.point_mm;
  TableShadow shadow{.at_mm = ShadowOnTable(s, x)};
  const double fall_mm = s.z() - x.z();
  shadow.by_position.leftCols<2>() = Eigen::Matrix2d::Identity() * (1.0 - s.z() / fall_mm);
  shadow.by_position.col(2) = (s - x).head<2>() * (x.z() / (fall_mm * fall_mm));
  return shadow;
}

Result<FieldFit> FitField(const std::vector<SheetSample>& samples, const Light& ruler,
                          const std::vector<size_t>& indices, const std::vector<size_t>& held_out,
                          double roughness_weight, const FieldFitOptions& options) {
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  if (ruler.model != LightModel::kLed) {
    return Fail(ErrorCode::kInvalidArgument, "the light is of the rung {}; need led",
                Name(ruler.model));
  }
  FieldFitter fitter(samples, ruler, options);
  FieldFit fit{.roughness_weight = roughness_weight};
  fitter.DescendWeighted(indices, roughness_weight);
  const auto admit = [&] {
    const std::vector<double> off = fitter.Residuals(indices);
    fit.used = OnModel(indices, off, SpreadOf(off));
  };
  admit();
  if (!held_out.empty()) {
    fit.roughness_weight = fitter.BestRoughness(fit.used, held_out);
  }
  for (int admission = 0; admission < kAdmissions; ++admission) {
    fitter.DescendSquares(fit.used, fit.roughness_weight);
    admit();
  }
  if (2 * fit.used.size() < indices.size()) {
    return Fail(ErrorCode::kDegenerate, "only {} of {} samples follow one light; need half",
                fit.used.size(), indices.size());
  }
  fit.covariance = fitter.Normalise(fit.used, fit.roughness_weight);
  fit.light = fitter.Current();
  fit.iterations = fitter.Iterations();
  if (Status status = CheckField(fit.light); !status) {
    return tl::unexpected(status.error());
  }
  return fit;
}

}  // namespace sateen
