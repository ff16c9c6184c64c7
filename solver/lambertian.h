#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "imaging/light_stack.h"
#include "rig/rig.h"
#include "solver/lobe/lobe_term.h"

namespace sateen {

// How equation (3) is solved. All give the same answer to within rounding.
enum class Backend {
  kJacobiSvd,  // Eigen JacobiSVD in double, dynamic size: the reference
  kQr,         // Householder QR with column pivoting, in double
  kLdlt,       // the 3x3 normal equations by LDL^T, in double
  kFast,       // the 3x3 normal equations in float vectors; refuses what float cannot hold
  kAuto        // kFast, then kJacobiSvd for each pixel that it refused
};

[[nodiscard]] std::string_view Name(Backend backend);
// Nothing for a name that no backend has.
[[nodiscard]] std::optional<Backend> BackendNamed(std::string_view name);

// Why a pixel has no answer, or that it has one. The values are what reason.png holds.
enum class Reason : uint8_t {
  kOutsideMask = 0,
  kDark = 64,             // no light gives a reading above the dark level
  kTooFewSamples = 96,    // fewer than three usable samples: the others are in shadow or invalid
  kSaturated = 128,       // fewer than three usable samples, and saturation took some
  kIllConditioned = 192,  // the lights of the usable samples lie too near one plane
  kSolved = 255
};

struct LambertianOptions {
  Backend backend = Backend::kAuto;
  // A sample is in shadow where its luminance, intensity divided out, is at or below this fraction
  // of the pixel's brightest unsaturated sample. In [0, 1).
  double shadow_level = 0.01;
  // A sample is saturated where any channel is at or above this fraction of full scale. In (0, 1].
  double clip_level = 0.98;
  // A pixel is dark where no channel of any sample is above this fraction of full scale, or above 0
  // where nothing saturates. In [0, 1).
  double dark_level = 1e-4;
  // A pixel is ill-conditioned where the usable lights' condition number (largest over smallest
  // singular value of the l_k) is above this. kFast goes by an upper bound, up to three times too
  // large, and refuses above about 14 in any case. In [2, 1e6].
  double max_condition = 1000.0;
  // Height of each pixel's point above the table plane, in millimetres, as solver/height.h finds it; finite,
  // and below the camera and near lights. Borrowed, of the stack's size; null: 0.
  const Image<float>* height_mm = nullptr;

  [[nodiscard]] double HeightAt(int column, int row) const {
    return height_mm == nullptr ? 0.0 : static_cast<double>(height_mm->At(column, row));
  }
  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// What a pixel's normal comes from. The values are what model.png holds.
enum class Rung : uint8_t {
  kNone = 0,           // unsolved, or solved by SolveLambertian, which has no ladder
  kLeastSquares = 64,  // weighted least squares explain the samples
  kUnchecked = 96,     // the same with three samples, so that no residual is left to tell
  kConsensus = 128,    // samples that agree, against others that do not
  kLobe = 192,         // a Lambertian body under a lobe that the scene has in common
  kUnexplained = 255   // fewer than four samples agree: do not trust
};

// What one rung of the ladder did.
struct RungSummary {
  int64_t pixels = 0;  // that it gave the answer of
  double seconds = 0.0;
  double mean_uncertainty_deg = 0.0;
};

struct SolveSummary {
  int64_t pixels = 0;  // inside the mask
  int64_t solved = 0;
  int64_t dark = 0;
  int64_t too_few_samples = 0;
  int64_t saturated = 0;
  int64_t ill_conditioned = 0;
  int64_t resolved_by_reference = 0;  // kAuto: refused by kFast, given to kJacobiSvd
  // SolveLadder alone. `robust` counts kUnexplained, too.
  RungSummary least_squares;
  RungSummary robust;
  RungSummary under_lobe;
  std::optional<Lobe> lobe;  // what the scene has in common, where it has one
  int64_t unexplained = 0;
  int64_t unchecked = 0;
  double turned_deg = 0.0;   // mean angle by which rung 2 turned its pixels' normals
  double noise_scale = 0.0;  // s of solver/ladder.h; 0: without a ladder, or not known
  bool noise_known = false;
  double seconds = 0.0;
  int threads = 0;
  Backend backend = Backend::kAuto;
  std::string_view instruction_set;  // kFast, kAuto: what the loop was compiled for; else empty
};

struct NormalField {
  Image3 normal;           // unit, table frame; zero where unsolved
  Image3 albedo;           // linear RGB, 1 = perfect white diffuser; zero where unsolved
  Image<float> residual;   // RMS of equation (3) over the usable samples; zero where unsolved
  Image<uint8_t> samples;  // usable samples, 255 = 255 or more
  Image<uint8_t> reason;   // of type Reason
  // SolveLadder alone; SolveLambertian leaves them empty.
  Image<float> uncertainty;  // degrees, one standard deviation of the normal's angle
  Image<float>
      albedo_uncertainty;  // standard deviation of the albedo's luminance over itself, at most 1
  Image<uint8_t> model;    // of type Rung
  SolveSummary summary;

  // Reallocates where the size differs; the content is not defined until a solve.
  void Resize(ImageSize size);
};

[[nodiscard]] inline bool IsSolved(const NormalField& field, size_t pixel) {
  return field.reason.pixels[pixel] == static_cast<uint8_t>(Reason::kSolved);
}

/// Surface normal and albedo per pixel, from K frames under K known lights.
///
///     i_kc = rho_c e_kc(x) max(0, n . l_k(x)),            k = 1..K, c = red, green, blue     (1)
///     i'_kc = i_kc / e_kc(x),  i'_k = 0.2126 i'_kr + 0.7152 i'_kg + 0.0722 i'_kb             (2)
///     N = argmin sum_k w_k (i'_k - N . l_k)^2,  N_c likewise from i'_kc                      (3)
///     n = N / |N|,  rho_c = |N_c|,  residual = sqrt(sum_k w_k (i'_k - N . l_k)^2 / sum_k w_k) (4)
///
/// where l_k(x) and e_k(x) are IncidentAt(light k, x) of rig/light.h at the point x in which the
/// pixel's ray meets the table plane z = 0, or its height_mm, and w_k = 1 where sample k is usable, else 0: finite,
/// not saturated, not in shadow (LambertianOptions). Four systems a pixel with one matrix.
///
/// stack    K frames, H x W
/// rig      K lights in the order of the frames; the camera, where a light is not distant
/// mask     H x W or nothing: all pixels count
/// Returns  H x W; unsolved pixels are zero in every map and have a reason
/// Errors   kInvalidArgument: option out of range
///          kBadData: stack, rig, mask or heights disagree in count or size; a light or height out of range
///          kDegenerate: fewer than three lights; all lights distant and in one plane
///          kCancelled
/// Cost     O(H W K), no allocation per pixel in kFast; the same bits for any number of threads
/// Source   Woodham, "Photometric method for determining surface orientation from multiple
///          images", Optical Engineering 19(1), 1980; four solves and per-pixel lights: Neubelt and
///          Pettineo, "Crafting a Next-Gen Material Pipeline for The Order: 1886", 2013, eqs 24-29.
[[nodiscard]] Result<NormalField> SolveLambertian(const LightStack& stack, const Rig& rig,
                                                  const std::optional<Mask>& mask,
                                                  const LambertianOptions& options = {},
                                                  const Task& task = {});

// The same into a field that may hold an earlier result: of the same size, its memory is used
// again. On failure the content is not defined.
[[nodiscard]] Status SolveLambertianInto(const LightStack& stack, const Rig& rig,
                                         const std::optional<Mask>& mask,
                                         const LambertianOptions& options, const Task& task,
                                         NormalField& field);

}  // namespace sateen
