#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "imaging/image.h"

// Results of a solve: maps and a summary, as values that own what they hold.
namespace sateen {

// Numerics of plain least squares, equation (3) of solver/lambertian.h. All give the same answer to
// within rounding.
enum class Backend {
  kJacobiSvd,  // Eigen JacobiSVD in double, dynamic size: the reference
  kQr,         // Householder QR with column pivoting, in double
  kLdlt,       // the 3x3 normal equations by LDL^T, in double
  kFast,       // the 3x3 normal equations in float vectors; refuses what float cannot hold
  kAuto        // kFast, then kJacobiSvd for each pixel that it refused
};

[[nodiscard]] std::string_view Name(Backend backend);
// Returns nothing for a name that no backend has.
[[nodiscard]] std::optional<Backend> BackendNamed(std::string_view name);

// Reason why a pixel has no answer, or that it has one. The values are those of reason.png.
enum class Reason : uint8_t {
  kOutsideMask = 0,
  kDark = 64,             // no light gives a reading above the dark level
  kTooFewSamples = 96,    // fewer than three usable samples: the others are in shadow or invalid
  kSaturated = 128,       // fewer than three usable samples, and saturation took some
  kIllConditioned = 192,  // the lights of the usable samples lie too near one plane
  kSolved = 255
};

// Rung of solver/ladder.h that a pixel's normal comes from. The values are those of model.png.
enum class Rung : uint8_t {
  kNone = 0,           // unsolved, or solved without the ladder
  kLeastSquares = 64,  // weighted least squares explain the samples
  kUnchecked = 96,     // the same with three samples, so that no residual is left to check
  kConsensus = 128,    // the samples that agree with each other
  kLobe = 192,         // a Lambertian body under a lobe common to the scene
  kUnexplained = 255   // fewer than four samples agree: do not trust
};

// Models of the lobe of rung 3 (reflectance/specular.h).
enum class LobeModel {
  kCloth,          // fuzz
  kGgx,            // gloss
  kGgxAnisotropic  // gloss of yarns
};

// Returns the name that scene files use: "cloth", "ggx" or "ggx-anisotropic".
[[nodiscard]] std::string_view Name(LobeModel model);

// Surface reflection of a whole scene, on top of its Lambertian body (solver/lobe/lobe.h).
struct Lobe {
  LobeModel model = LobeModel::kCloth;
  double alpha = 0.0;     // roughness; for yarns, across their fibres
  double strength = 0.0;  // factor on the model with F0 = 0.04
  // For kGgxAnisotropic: roughness along the fibres, and the direction in which `alpha` applies, as
  // an angle from x on the table in [0, 180). The other set of yarns (warp or weft) lies at a right
  // angle.
  double alpha_along = 0.0;
  double azimuth_deg = 0.0;
  double share = 1.0;  // of the pixels that have it
};

// Work of one rung.
struct RungSummary {
  int64_t pixels = 0;  // that take their answer from it
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
  // Ladder only; zero and empty without it. `robust` includes kUnexplained.
  RungSummary least_squares;
  RungSummary robust;
  RungSummary under_lobe;
  std::optional<Lobe> lobe;  // of the scene, where it has one
  int64_t unexplained = 0;
  int64_t unchecked = 0;
  double turned_deg = 0.0;   // mean angle by which rung 2 changed its pixels' normals
  double noise_scale = 0.0;  // s of solver/robust/noise_scale.h; 0: without the ladder, or unknown
  bool noise_known = false;
  double seconds = 0.0;
  int threads = 0;
  Backend backend = Backend::kAuto;
  std::string_view instruction_set;  // of the vectors of kFast and kAuto; otherwise empty
};

struct NormalField {
  Image3 normal;           // unit, table frame; zero where unsolved
  Image3 albedo;           // linear RGB, 1 = perfect white diffuser; zero where unsolved
  Image<float> residual;   // RMS of the fit over the usable samples; zero where unsolved
  Image<uint8_t> samples;  // usable samples, 255 = 255 or more
  Image<uint8_t> reason;   // of type Reason
  // Ladder only; empty without it.
  Image<float> uncertainty;  // degrees, one standard deviation of the normal's angle
  Image<float>
      albedo_uncertainty;  // relative standard deviation of the albedo's luminance, at most 1
  Image<uint8_t> model;    // of type Rung
  SolveSummary summary;

  // Reallocates where the size differs; the content is undefined until a solve. Without a ladder,
  // its three maps become empty.
  void Resize(ImageSize size, bool with_ladder = false);
};

[[nodiscard]] inline bool IsSolved(const NormalField& field, size_t pixel) {
  return field.reason.pixels[pixel] == static_cast<uint8_t>(Reason::kSolved);
}

}  // namespace sateen
