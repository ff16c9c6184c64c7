#pragma once

#include <optional>
#include <string_view>

#include "solver/lambertian.h"
#include "solver/noise.h"

namespace sateen {

enum class LadderMode {
  kAuto,          // each pixel takes the lowest rung that explains its samples
  kLeastSquares,  // rung 1 on every pixel
  kConsensus      // rung 2 on every pixel with more than three samples
};

// Returns "auto", "least-squares" or "robust".
[[nodiscard]] std::string_view Name(LadderMode mode);
// Returns nothing for a name that no mode has.
[[nodiscard]] std::optional<LadderMode> LadderModeNamed(std::string_view name);

// When a pixel leaves rung 1.
struct ClimbOptions {
  // Probability with which noise alone makes a pixel climb. In (0, 0.5).
  double false_alarms = 3e-4;
  // Residual, relative to the albedo, up to which no pixel climbs: no calibration is better. In [0,
  // 1).
  double explained_residual = 0.002;

  // Fails on the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

struct LadderOptions {
  LadderMode mode = LadderMode::kAuto;
  LambertianOptions least_squares;
  // Noise of each frame. Nothing: shot noise of a gain that is measured on the residuals.
  std::optional<StackNoise> noise;
  ClimbOptions climb;

  // Fails on the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// Returns surface normal, albedo and uncertainty per pixel, from the lowest rung that explains its
/// samples.
///
/// | rung | model                                              | equations                       |
/// | ---- | -------------------------------------------------- | ------------------------------- |
/// | 1    | least squares, weighted by the samples' noise      | solver/least_squares/weighted.h |
/// | 2    | consensus of the samples that agree                | solver/robust/consensus.h       |
/// | 3    | a Lambertian body under a lobe common to the scene | solver/lobe/lobe.h              |
///
/// Rung 1 solves every pixel, and its noise scale s is measured first
/// (solver/robust/noise_scale.h). A pixel is explained where
///
///     misfit <= s^2 q(chi^2 / (usable - 3)),  q: its 1 - false_alarms quantile                (1)
///
/// and climbs where it is not, its residual is above explained_residual |N|, and rung 3 does not
/// take it.
///
/// Rung 3 is tried in mode kAuto, for a rig with a camera, where rung 1 explains fewer than 80 % of
/// the pixels and a search finds a lobe (solver/lobe/lobe_search.h). All other pixels that climb
/// take rung 2. A pixel with three usable samples, which nothing can check, is kUnchecked.
///
/// Uncertainties of pixels on rung 1 grow by the errors of the model that others show:
///
///   * where 2 to 20 % of the pixels climb, by 0 to all of hypot(3 degrees, 0.4 t), t being the
///     mean angle by which rung 2 changed those pixels' normals; of kUnchecked pixels by all of t;
///   * where a lobe was found, by the difference of both answers times the root of the probability
///     of the other answer; so do those of rung 3;
///   * by the errors of the lights' calibration (solver/light_doubt.h).
///
/// Where all frames are camera RAW, the interpolation of their colours adds to every pixel
/// (solver/robust/interpolation.h).
///
/// stack, rig, mask, heights, errors   as SolveLambertian
/// Cost     rung 1 1.4 times SolveLambertian; rung 2 O(K^2 + K 10^3) per pixel; rung 3 some
///          microseconds per pixel and 0.1 to 3 s to find; the same bits for any number of threads
[[nodiscard]] Result<NormalField> SolveLadder(const LightStack& stack, const Rig& rig,
                                              const std::optional<Mask>& mask,
                                              const LadderOptions& options = {},
                                              const Task& task = {},
                                              const std::optional<Image<float>>& height_mm = {});

// Solves into a field that may hold an earlier result, like SolveLambertianInto.
[[nodiscard]] Status SolveLadderInto(const LightStack& stack, const Rig& rig,
                                     const std::optional<Mask>& mask, const LadderOptions& options,
                                     const Task& task, NormalField& field,
                                     const std::optional<Image<float>>& height_mm = {});

}  // namespace sateen
