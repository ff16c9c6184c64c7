#include "solver/ladder.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/angle.h"
#include "core/parallel.h"
#include "imaging/color.h"
#include "solver/consensus.h"
#include "solver/fast_rows.h"
#include "solver/least_squares.h"
#include "solver/plain_ladder.h"

namespace sateen {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::array<std::pair<LadderMode, std::string_view>, 3> kModeNames = {{
    {LadderMode::kAuto, "auto"},
    {LadderMode::kLeastSquares, "least-squares"},
    {LadderMode::kConsensus, "robust"},
}};

// Of the misfits, for the noise's scale. Where its gain is unknown only the best pixels tell of it,
// because of a shiny sample most of them tell of the shine.
constexpr double kShareOfKnown = 0.25;
constexpr double kShareOfUnknown = 0.05;
// Demosaicing leaves at least this of the variance: a quarter of it where four sites are averaged,
// and the luminance averages three colours that have sites in common.
constexpr double kLeastScaleSquared = 0.1;
constexpr double kQuarterOfOneFreedom = 0.1015;  // quantile of chi^2
constexpr size_t kBlock = 256;                   // pixels that are looked at together
constexpr size_t kMisfitsLookedAt = 1 << 14;
// Rounding's variance is 1/12 of a step squared, of which 1/6 goes for the variance of a sample; of
// the second differences that do not vanish at least this share are single steps.
constexpr double kRoundingOfStep = 6.0 / 12.0;
constexpr double kShareOfSteps = 0.05;
// Second differences below this fraction of the first, or of the samples, vanish: steps of equal
// size, of an 8-bit file as sRGB, too, and what rounding to float leaves of nothing.
constexpr float kLeastBend = 0.02F;
constexpr float kFloatBend = 4.0F * std::numeric_limits<float>::epsilon();
constexpr auto kFloatStep = static_cast<double>(std::numeric_limits<float>::epsilon());
constexpr double kNotKnown = std::numeric_limits<double>::infinity();
constexpr float kUnexplainedFactor = 3.0F;
// Where more pixels than this climb, the model is wrong in what noise hides in the others, too.
constexpr double kDoubtfulShare = 0.2;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Quantile of the normal distribution, for share >= 0.5 or below by symmetry: Abramowitz and Stegun
// 26.2.23, to 4.5e-4, and a step of Newton's.
double NormalQuantile(double share) {
  if (share < 0.5) {
    return -NormalQuantile(1.0 - share);
  }
  const double t = std::sqrt(-2.0 * std::log(1.0 - share));
  const double z = t - (2.515517 + t * (0.802853 + t * 0.010328)) /
                           (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
  const double beyond = 0.5 * std::erfc(z / std::numbers::sqrt2);
  const double density = std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
  return z + (beyond - (1.0 - share)) / density;
}

// Solved pixels at equal distances in their own order: what is looked at depends neither on the
// threads nor on how much of the image the mask leaves out.
std::vector<size_t> PixelsLookedAt(const NormalField& field) {
  const size_t step =
      std::max<size_t>(1, static_cast<size_t>(field.summary.solved) / kMisfitsLookedAt);
  std::vector<size_t> pixels;
  size_t solved = 0;
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    if (IsSolved(field, p) && solved++ % step == 0) {
      pixels.push_back(p);
    }
  }
  return pixels;
}

// How many usable samples most of these pixels have, of those that leave a residual; 0: none.
int UsualSamples(const NormalField& field, std::span<const size_t> pixels) {
  std::array<int64_t, 256> counts = {};
  for (const size_t p : pixels) {
    ++counts[field.samples.pixels[p]];
  }
  const auto most = std::max_element(counts.begin() + 4, counts.end());
  return *most > 0 ? static_cast<int>(most - counts.begin()) : 0;
}

float QuantileOf(std::vector<float>& values, double share) {
  const auto place =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

// What neighbouring samples tell of the noise.
struct Neighbours {
  double scale_squared = kNotKnown;  // infinite where they tell nothing
  double floor = 0.0;                // of s^2: what rounding to float leaves, in exact frames, too
};

// s^2 where noise is unknown, var = s^2 i, from second differences along the rows of green samples,
// of variance 6 var: too large by what the surface does from pixel to pixel, not by what the model
// does not know. Differences that vanish are the work of rounding to few bits, which is not without
// noise: where they are many, s^2 is the mean, and at least the variance of rounding, 1/12 of a step
// squared.
Neighbours LookAtNeighbours(const LightStack& stack, const NormalField& field,
                            std::span<const size_t> pixels) {
  std::vector<float> squares;
  double sum_of_squares = 0.0;
  double sum_of_means = 0.0;
  size_t count = 0;
  const auto width = static_cast<size_t>(field.reason.width);
  for (const size_t p : pixels) {
    const bool inside =
        p % width > 0 && p % width + 1 < width && IsSolved(field, p - 1) && IsSolved(field, p + 1);
    for (size_t k = 0; inside && k < stack.size(); ++k) {
      const float* i = stack[k].rgb[1].pixels.data() + p;
      const float bend = i[-1] - 2.0F * i[0] + i[1];
      const float mean = (i[-1] + i[0] + i[1]) / 3.0F;
      if (!(mean > 0.0F && std::isfinite(bend) && i[0] < stack[k].full_scale)) {
        continue;
      }
      ++count;
      sum_of_means += static_cast<double>(mean);
      if (std::abs(bend) > std::max(kLeastBend * std::abs(i[1] - i[-1]), kFloatBend * mean)) {
        squares.push_back(bend * bend / (6.0F * mean));
        sum_of_squares += static_cast<double>(squares.back());
      }
    }
  }
  if (squares.empty()) {
    return {};
  }
  const auto all = static_cast<double>(count);
  const double of_float = kFloatStep * kFloatStep / 12.0 * sum_of_means / all;
  const auto quarter = static_cast<double>(QuantileOf(squares, 0.25));
  if (4 * squares.size() >= 3 * count) {
    return {.scale_squared = quarter / kQuarterOfOneFreedom, .floor = of_float};
  }
  const auto least = static_cast<double>(QuantileOf(squares, kShareOfSteps));
  return {.scale_squared = std::max(sum_of_squares / all, kRoundingOfStep * quarter),
          .floor = std::max(of_float, kRoundingOfStep * least)};
}

// s^2; infinite where nothing tells of it.
double NoiseScaleSquared(const LightStack& stack, const NormalField& field,
                         const Image<float>& misfit, bool known) {
  const std::vector<size_t> pixels = PixelsLookedAt(field);
  const int usual = UsualSamples(field, pixels);
  double scale = kNotKnown;
  if (usual > 0) {
    std::vector<float> misfits;
    for (const size_t p : pixels) {
      if (field.samples.pixels[p] == usual) {
        misfits.push_back(misfit.pixels[p]);
      }
    }
    const double share = known ? kShareOfKnown : kShareOfUnknown;
    scale = static_cast<double>(QuantileOf(misfits, share)) / ChiSquaredQuantile(share, usual - 3);
  }
  if (known) {
    return std::clamp(scale, kLeastScaleSquared, 1.0);
  }
  const Neighbours neighbours = LookAtNeighbours(stack, field, pixels);
  scale = std::max(std::min(scale, neighbours.scale_squared), neighbours.floor);
  if (scale > 0.0) {
    return scale;
  }
  return kNotKnown;
}

// What the second pass knows.
struct Climb {
  const LightStack& stack;
  const Rig& rig;
  const LadderOptions& options;
  const std::optional<FastRows>& fast_rows;  // nothing: in double
  double scale_squared = 1.0;
  std::array<float, 256> limit = {};  // of the misfit, by usable samples
};

bool NeedsConsensus(const Climb& climb, const NormalField& field, const Image<float>& misfit,
                    size_t pixel) {
  if (field.samples.pixels[pixel] <= 3) {
    return false;  // three samples always agree
  }
  if (climb.options.mode != LadderMode::kAuto) {
    return climb.options.mode == LadderMode::kConsensus;
  }
  if (misfit.pixels[pixel] <= climb.limit[field.samples.pixels[pixel]]) {
    return false;
  }
  const float albedo = kLuminance[0] * field.albedo[0].pixels[pixel] +
                       kLuminance[1] * field.albedo[1].pixels[pixel] +
                       kLuminance[2] * field.albedo[2].pixels[pixel];
  return field.residual.pixels[pixel] >
         static_cast<float>(climb.options.explained_residual) * albedo;
}

struct PieceSummary {
  int64_t least_squares = 0;
  int64_t robust = 0;
  int64_t unexplained = 0;
  int64_t unchecked = 0;
  double least_squares_deg = 0.0;  // sums
  double robust_deg = 0.0;
  double turned_deg = 0.0;

  void Add(const PieceSummary& other) {
    least_squares += other.least_squares;
    robust += other.robust;
    unexplained += other.unexplained;
    unchecked += other.unchecked;
    least_squares_deg += other.least_squares_deg;
    robust_deg += other.robust_deg;
    turned_deg += other.turned_deg;
  }
};

Eigen::Vector3f NormalAt(const NormalField& field, size_t pixel) {
  return {field.normal[0].pixels[pixel], field.normal[1].pixels[pixel],
          field.normal[2].pixels[pixel]};
}

// As FastRows::SolveConsensus, in double.
void SolveConsensusInDouble(const Climb& climb, std::span<const size_t> pixels, NormalField& field,
                            std::span<uint8_t> agreeing) {
  PixelSystem system(climb.stack, climb.rig, climb.options.least_squares);
  const auto width = static_cast<size_t>(field.reason.width);
  for (size_t j = 0; j < pixels.size(); ++j) {
    const size_t pixel = pixels[j];
    system.Gather(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
    const PlainAnswer answer = PlainConsensus(system, climb.options.least_squares.max_condition);
    const Eigen::Vector3d n = answer.n.stableNormalized();
    if (!n.allFinite() || n.isZero()) {
      agreeing[j] = 0;
      continue;
    }
    for (size_t c = 0; c < 3; ++c) {
      const auto column = static_cast<Eigen::Index>(c);
      field.normal[c].pixels[pixel] = static_cast<float>(n[column]);
      field.albedo[c].pixels[pixel] = static_cast<float>(answer.n_rgb.col(column).norm());
    }
    field.residual.pixels[pixel] = static_cast<float>(answer.residual);
    field.uncertainty.pixels[pixel] = static_cast<float>(std::min(answer.uncertainty_deg, 180.0));
    agreeing[j] = static_cast<uint8_t>(std::min(answer.agreeing, 255));
  }
}

// What float refused, once more in double.
void SolveRefusedInDouble(const Climb& climb, std::span<const size_t> pixels, NormalField& field,
                          std::span<uint8_t> agreeing) {
  std::vector<size_t> places;
  std::vector<size_t> refused;
  for (size_t j = 0; j < pixels.size(); ++j) {
    if (agreeing[j] == 0) {
      places.push_back(j);
      refused.push_back(pixels[j]);
    }
  }
  if (refused.empty()) {
    return;
  }
  std::vector<uint8_t> of_refused(refused.size());
  SolveConsensusInDouble(climb, refused, field, of_refused);
  for (size_t j = 0; j < places.size(); ++j) {
    agreeing[places[j]] = of_refused[j];
  }
}

// Rung 1's word on pixels [begin, end); appends those that have to climb to `pixels`.
void KeepOrClimb(const Climb& climb, const Image<float>& misfit, size_t begin, size_t end,
                 NormalField& field, PieceSummary& summary, std::vector<size_t>& pixels) {
  const bool always = climb.options.mode == LadderMode::kConsensus;
  const bool never = climb.options.mode == LadderMode::kLeastSquares;
  const auto scale = static_cast<float>(std::sqrt(climb.scale_squared));
  const float lowest = *std::min_element(climb.limit.begin(), climb.limit.end());
  const uint8_t* const reason = field.reason.pixels.data();
  const uint8_t* const samples = field.samples.pixels.data();
  const float* const misfits = misfit.pixels.data();
  uint8_t* const model = field.model.pixels.data();
  float* const uncertainty = field.uncertainty.pixels.data();
  constexpr auto kSolvedCode = static_cast<uint8_t>(Reason::kSolved);
  // Without branches, so that these become vectors.
  for (size_t p = begin; p < end; ++p) {
    const Rung rung = samples[p] <= 3 ? Rung::kUnchecked : Rung::kLeastSquares;
    model[p] = reason[p] == kSolvedCode ? static_cast<uint8_t>(rung) : uint8_t{0};
  }
  int solved = 0;
  int unchecked = 0;
  for (size_t p = begin; p < end; ++p) {
    solved += reason[p] == kSolvedCode ? 1 : 0;
    unchecked += model[p] == static_cast<uint8_t>(Rung::kUnchecked) ? 1 : 0;
  }
  int suspects = always ? 1 : 0;
  for (size_t p = begin; p < end; ++p) {
    // In this order the minimum of 180 and not-a-number, of an infinite scale, is 180.
    uncertainty[p] = reason[p] == kSolvedCode ? std::min(180.0F, uncertainty[p] * scale) : 0.0F;
    suspects |= misfits[p] > lowest ? 1 : 0;
  }
  double sum_deg = 0.0;
  for (size_t p = begin; p < end; ++p) {
    sum_deg += static_cast<double>(uncertainty[p]);  // zero where unsolved
  }
  if (suspects != 0 && !never) {
    for (size_t p = begin; p < end; ++p) {
      if (IsSolved(field, p) && NeedsConsensus(climb, field, misfit, p)) {
        pixels.push_back(p);
        --solved;
        sum_deg -= static_cast<double>(uncertainty[p]);
      }
    }
  }
  summary.least_squares += solved - unchecked;
  summary.unchecked += unchecked;
  summary.least_squares_deg += sum_deg;
}

// Rung 2 for the pixels of one piece.
void ClimbPixels(const Climb& climb, int begin, int end, std::span<const size_t> pixels,
                 NormalField& field, PieceSummary& summary) {
  std::vector<Eigen::Vector3f> before;
  before.reserve(pixels.size());
  for (const size_t pixel : pixels) {
    before.push_back(NormalAt(field, pixel));
  }
  std::vector<uint8_t> agreeing(pixels.size());
  if (climb.fast_rows) {
    climb.fast_rows->SolveConsensus(begin, end, pixels, field, agreeing);
    if (climb.options.least_squares.backend == Backend::kAuto) {
      SolveRefusedInDouble(climb, pixels, field, agreeing);
    }
  } else {
    SolveConsensusInDouble(climb, pixels, field, agreeing);
  }
  for (size_t j = 0; j < pixels.size(); ++j) {
    const bool explained = agreeing[j] >= kFewestAgreeing;
    float& uncertainty = field.uncertainty.pixels[pixels[j]];
    if (!explained) {
      uncertainty = std::min(180.0F, uncertainty * kUnexplainedFactor);
      ++summary.unexplained;
    }
    field.model.pixels[pixels[j]] =
        static_cast<uint8_t>(explained ? Rung::kConsensus : Rung::kUnexplained);
    const Eigen::Vector3f after = NormalAt(field, pixels[j]);
    summary.turned_deg += std::atan2(static_cast<double>(before[j].cross(after).norm()),
                                     static_cast<double>(before[j].dot(after))) *
                          kDegPerRad;
    summary.robust_deg += static_cast<double>(uncertainty);
  }
  summary.robust += static_cast<int64_t>(pixels.size());
}

PieceSummary ClimbRows(const Climb& climb, const Image<float>& misfit, int begin, int end,
                       NormalField& field) {
  PieceSummary summary;
  std::vector<size_t> pixels;
  const size_t last = field.reason.Index(0, end);
  for (size_t p = field.reason.Index(0, begin); p < last; p += kBlock) {
    KeepOrClimb(climb, misfit, p, std::min(p + kBlock, last), field, summary, pixels);
  }
  if (!pixels.empty()) {
    ClimbPixels(climb, begin, end, pixels, field, summary);
  }
  return summary;
}

// Adds the model's error to the uncertainty of rung 1, for a scene in which many pixels climbed.
Status DoubtLeastSquares(const Task& task, NormalField& field, PieceSummary& total) {
  const ImageSize size = field.reason.Size();
  std::vector<double> sums(static_cast<size_t>(size.height), 0.0);
  Status status = ParallelFor(
      size.height, RowsPerPiece(size), {.threads = task.threads, .cancel = task.cancel},
      [&](int begin, int end) {
        for (size_t p = field.model.Index(0, begin); p < field.model.Index(0, end); ++p) {
          if (field.model.pixels[p] == static_cast<uint8_t>(Rung::kLeastSquares) ||
              field.model.pixels[p] == static_cast<uint8_t>(Rung::kUnchecked)) {
            float& uncertainty = field.uncertainty.pixels[p];
            uncertainty = std::min(180.0F, std::hypot(uncertainty, kLeastModelUncertaintyDeg));
            sums[static_cast<size_t>(begin)] += static_cast<double>(uncertainty);
          }
        }
      });
  total.least_squares_deg = 0.0;
  for (const double sum : sums) {
    total.least_squares_deg += sum;
  }
  return status;
}

Status CheckNoise(const std::optional<StackNoise>& noise, const LightStack& stack) {
  for (size_t k = 0; noise && k < stack.size(); ++k) {
    for (size_t c = 0; c < 3; ++c) {
      const double shot = (*noise)[k].shot[c];
      const double read = (*noise)[k].read[c];
      if (!(std::isfinite(shot) && std::isfinite(read) && shot >= 0.0 && read >= 0.0 &&
            shot + read > 0.0)) {
        return Fail(ErrorCode::kInvalidArgument,
                    "noise of {}, channel {}: shot = {:g}, read = {:g}; need both finite and >= 0, "
                    "and one of them > 0",
                    stack[k].name, c, shot, read);
      }
    }
  }
  return {};
}

void Report(const PieceSummary& total, double climbing_seconds, SolveSummary& summary) {
  const auto mean = [](double sum, int64_t count) {
    return count > 0 ? sum / static_cast<double>(count) : 0.0;
  };
  summary.robust.seconds = total.robust > 0 ? climbing_seconds : 0.0;
  summary.least_squares = {total.least_squares + total.unchecked, summary.seconds,
                           mean(total.least_squares_deg, total.least_squares + total.unchecked)};
  summary.robust.pixels = total.robust;
  summary.robust.mean_uncertainty_deg = mean(total.robust_deg, total.robust);
  summary.turned_deg = mean(total.turned_deg, total.robust);
  summary.unexplained = total.unexplained;
  summary.unchecked = total.unchecked;
}

// The second pass: decides for every pixel whether rung 1 explains it.
Status ClimbAllRows(const Climb& climb, const Image<float>& misfit, const Task& task,
                    NormalField& field) {
  const Clock::time_point start = Clock::now();
  const ImageSize size = field.reason.Size();
  std::vector<PieceSummary> pieces(static_cast<size_t>(size.height));
  task.BeginStage("climbing", size.height);
  Status status = ParallelFor(size.height, RowsPerPiece(size), task, [&](int begin, int end) {
    pieces[static_cast<size_t>(begin)] = ClimbRows(climb, misfit, begin, end, field);
  });
  PieceSummary total;
  for (const PieceSummary& piece : pieces) {
    total.Add(piece);
  }
  const int64_t solved = total.least_squares + total.unchecked + total.robust;
  if (status && static_cast<double>(total.robust) > kDoubtfulShare * static_cast<double>(solved)) {
    status = DoubtLeastSquares(task, field, total);
  }
  Report(total, SecondsSince(start), field.summary);
  return status;
}

}  // namespace

std::string_view Name(LadderMode mode) { return kModeNames[static_cast<size_t>(mode)].second; }

std::optional<LadderMode> LadderModeNamed(std::string_view name) {
  for (const auto& [value, mode_name] : kModeNames) {
    if (mode_name == name) {
      return value;
    }
  }
  return std::nullopt;
}

double ChiSquaredQuantile(double share, int freedom) {
  if (freedom == 1) {
    return std::pow(NormalQuantile(0.5 * (1.0 + share)), 2.0);
  }
  if (freedom == 2) {
    return -std::log(1.0 - share);
  }
  const double v = 2.0 / (9.0 * freedom);
  return std::pow(std::max(0.0, 1.0 - v + NormalQuantile(share) * std::sqrt(v)), 3.0);
}

Status LadderOptions::Validate() const {
  if (!(false_alarms > 0.0 && false_alarms < 0.5)) {
    return Fail(ErrorCode::kInvalidArgument, "false_alarms = {:g}; need 0 < false_alarms < 0.5",
                false_alarms);
  }
  if (!(explained_residual >= 0.0 && explained_residual < 1.0)) {
    return Fail(ErrorCode::kInvalidArgument,
                "explained_residual = {:g}; need 0 <= explained_residual < 1", explained_residual);
  }
  return least_squares.Validate();
}

Status SolveLadderInto(const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                       const LadderOptions& options, const Task& task, NormalField& field) {
  const Clock::time_point start = Clock::now();
  if (Status status = options.Validate(); !status) {
    return status;
  }
  if (options.noise && options.noise->size() != stack.size()) {
    return Fail(ErrorCode::kBadData, "noise of {} frames, but {} frames", options.noise->size(),
                stack.size());
  }
  if (Status status = CheckNoise(options.noise, stack); !status) {
    return status;
  }
  const StackNoise noise = options.noise ? *options.noise : UnknownNoise(stack.size());
  Image<float> misfit(stack.empty() ? ImageSize{} : stack[0].rgb.Size());
  if (Status status = SolveLeastSquaresInto(stack, rig, mask, options.least_squares, &noise, task,
                                            field, &misfit);
      !status) {
    return status;
  }
  std::optional<FastRows> fast_rows;
  const Backend backend = options.least_squares.backend;
  if (backend == Backend::kFast || backend == Backend::kAuto) {
    Result<FastRows> made = FastRows::Make(stack, rig, mask, options.least_squares, &noise);
    if (!made) {
      return tl::unexpected(made.error());
    }
    fast_rows = std::move(*made);
  }
  Climb climb{stack, rig, options, fast_rows};
  climb.scale_squared = NoiseScaleSquared(stack, field, misfit, options.noise.has_value());
  for (size_t usable = 4; usable < climb.limit.size(); ++usable) {
    climb.limit[usable] =
        static_cast<float>(climb.scale_squared * ChiSquaredQuantile(1.0 - options.false_alarms,
                                                                    static_cast<int>(usable) - 3));
  }
  for (size_t usable = 0; usable < 4; ++usable) {
    climb.limit[usable] = std::numeric_limits<float>::infinity();
  }
  field.summary.noise_scale =
      std::isfinite(climb.scale_squared) ? std::sqrt(climb.scale_squared) : 0.0;
  field.summary.noise_known = options.noise.has_value();
  Status status = ClimbAllRows(climb, misfit, task, field);
  field.summary.seconds = SecondsSince(start);
  return status;
}

Result<NormalField> SolveLadder(const LightStack& stack, const Rig& rig,
                                const std::optional<Mask>& mask, const LadderOptions& options,
                                const Task& task) {
  NormalField field;
  if (Status status = SolveLadderInto(stack, rig, mask, options, task, field); !status) {
    return tl::unexpected(status.error());
  }
  return field;
}

}  // namespace sateen
