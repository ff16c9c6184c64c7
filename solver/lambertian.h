#pragma once

#include <optional>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "imaging/light_stack.h"
#include "rig/rig.h"
#include "solver/normal_field.h"

namespace sateen {

struct LambertianOptions {
  Backend backend = Backend::kAuto;
  // Shadow: a sample whose luminance, irradiance divided out, is at or below this fraction of the
  // pixel's brightest unsaturated sample. In [0, 1).
  double shadow_level = 0.01;
  // Saturation: a sample with a channel at or above this fraction of full scale. In (0, 1].
  double clip_level = 0.98;
  // Darkness: a pixel without a channel above this fraction of full scale in any sample; above 0
  // where nothing saturates. In [0, 1).
  double dark_level = 1e-4;
  // Largest condition number (largest over smallest singular value of the l_k) of a pixel's usable
  // lights. kFast uses an upper bound of it, up to three times too large, and refuses above about
  // 14 in any case. In [2, 1e6].
  double max_condition = 1000.0;

  // Fails on the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// Returns surface normal and albedo per pixel, from K frames under K known lights.
///
///     i_kc = rho_c e_kc(x) max(0, n . l_k(x)),            k = 1..K, c = red, green, blue     (1)
///     i'_kc = i_kc / e_kc(x),  i'_k = 0.2126 i'_kr + 0.7152 i'_kg + 0.0722 i'_kb             (2)
///     N = argmin sum_k w_k (i'_k - N . l_k)^2,  N_c likewise from i'_kc                      (3)
///     n = N / |N|,  rho_c = |N_c|,  residual = sqrt(sum_k w_k (i'_k - N . l_k)^2 / sum_k w_k) (4)
///
/// where l_k(x) and e_k(x) are IncidentAt(light k, x) of rig/light.h at the point x in which the
/// pixel's ray meets the plane z = its height. w_k = 1 for a usable sample, else 0. A usable sample
/// is finite, not saturated and not in shadow (LambertianOptions). The four systems per pixel share
/// one matrix.
///
/// stack      K frames, H x W
/// rig        K lights in the order of the frames; a camera, unless all lights are distant
/// mask       H x W or nothing: all pixels count
/// height_mm  H x W or nothing: heights of the pixels' points above the table plane, as
///            IntegrateNormals() of solver/height.h finds them; below the camera and near lights.
///            [mm]
/// Returns    H x W; unsolved pixels are zero in every map and have a reason
/// Errors     kInvalidArgument: option out of range kBadData: stack, rig, mask or heights disagree
///            in count or size; a light or height is out of range kDegenerate: fewer than three
///            lights; all lights distant and in one plane kCancelled
/// Cost       O(H W K), no allocation per pixel in kFast; the same bits for any number of threads
/// Source     Woodham, "Photometric method for determining surface orientation from multiple
///            images", Optical Engineering 19(1), 1980; four solves and per-pixel lights: Neubelt
///            and Pettineo, "Crafting a Next-Gen Material Pipeline for The Order: 1886", 2013, eqs
///            24-29.
[[nodiscard]] Result<NormalField> SolveLambertian(
    const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
    const LambertianOptions& options = {}, const Task& task = {},
    const std::optional<Image<float>>& height_mm = std::nullopt);

// Solves into a field that may hold an earlier result; memory of the same size is used again. On
// failure the content is undefined.
[[nodiscard]] Status SolveLambertianInto(
    const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
    const LambertianOptions& options, const Task& task, NormalField& field,
    const std::optional<Image<float>>& height_mm = std::nullopt);

}  // namespace sateen
