#pragma once

#include <functional>
#include <optional>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "imaging/mosaic_stack.h"
#include "rig/rig.h"
#include "solver/ladder.h"
#include "solver/lambertian.h"

namespace sateen {

struct MosaicOptions {
  // Rungs of the ladder. Nothing: least squares without weights and without uncertainty.
  std::optional<LadderMode> mode = LadderMode::kAuto;
  // Backend kFast, kAuto, or kJacobiSvd for every site.
  LambertianOptions least_squares;
  ClimbOptions climb;
  // Rows that are solved, and passed on, together; at least 1.
  int band_rows = 256;

  // Fails on the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Receives rows [first_row, first_row + band height) of the maps. Bands come in order, and one call
// ends before the next begins. The band's memory is used again.
using BandSink = std::function<Status(int first_row, const NormalField& band)>;

/// Returns surface normal, albedo and uncertainty at every site of a mosaic, each from readings of
/// the site's own colour c. No colour is interpolated before the normals are known, and a third of
/// the numbers is read.
///
///     i_k = per_dn r_k + at_zero - dark,   i'_k = i_k / e_kc                                 (1)
///     var_k = f (shot_c max(N^0 . l_k, 0.02 |N^0|) + f read_c^2),  f = 1 / e_kc               (2)
///     N = argmin sum_k (i'_k - N . l_k)^2 / var_k over usable readings k of the site           (3)
///     n = N / |N|,  rho_c = |N|                                                                (4)
///     rho_c elsewhere = the mean of the nearest solved sites of colour c (bilinear)            (5)
///
/// r_k is the site's reading and N^0 the same N without weights. Readings are usable as samples are
/// in solver/lambertian.h.
///
/// Rungs and uncertainties are those of solver/ladder.h with one channel, with these differences:
///
///   * The noise is the sensor's own, s = 1, because no interpolation has changed it. Where the
///     stack does not know it, a gain is measured (solver/mosaic/mosaic_noise.h).
///   * Rung 2 also searches in the colours interpolated from a site's neighbours. It takes the
///     result where samples spread less than half as much and as many agree: highlights on coloured
///     cloth.
///   * A lobe (rung 3) is searched for where more than 2 % of the sites of some rows climb.
///
/// stack      K lit mosaics of H x W
/// rig        K lights in the order of the frames; a camera, unless all lights are distant
/// mask       H x W or nothing
/// height_mm  as SolveLambertian
/// Returns    H x W, as SolveLadder; without `mode` as SolveLambertian. `residual` is of the own
///            colour
/// Errors     as SolveLambertian; kBadData where the mosaic has no readings or is narrower than 64
///            sites; kIo where rows cannot be read; the errors of the sink
/// Cost       O(H W K): nine tenths of the same solve of interpolated colours, without the
///            interpolation; the same bits for any number of threads and any band_rows
[[nodiscard]] Result<NormalField> SolveMosaic(const MosaicStack& stack, const Rig& rig,
                                              const std::optional<Mask>& mask,
                                              const MosaicOptions& options = {},
                                              const Task& task = {},
                                              const std::optional<Image<float>>& height_mm = {});

// Solves into a field that may hold an earlier result, like SolveLambertianInto.
[[nodiscard]] Status SolveMosaicInto(const MosaicStack& stack, const Rig& rig,
                                     const std::optional<Mask>& mask, const MosaicOptions& options,
                                     const Task& task, NormalField& field,
                                     const std::optional<Image<float>>& height_mm = {});

// Solves band by band, so that memory does not grow with the height. The sink runs beside the solve
// of the next band. Returns the summary of the whole.
[[nodiscard]] Result<SolveSummary> SolveMosaicByBands(const MosaicStack& stack, const Rig& rig,
                                                      const std::optional<Mask>& mask,
                                                      const MosaicOptions& options,
                                                      const Task& task, const BandSink& sink);

}  // namespace sateen
