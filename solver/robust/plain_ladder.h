#pragma once

#include <Eigen/Core>
#include <span>

#include "solver/lambertian.h"
#include "solver/least_squares/pixel_system.h"
#include "solver/noise.h"

namespace sateen {

// The rungs of solver/ladder.h for one pixel, in double and as the equations stand there: what the
// fast kernel is tested against, and what solves the pixels that it refuses.
struct PlainAnswer {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();  // N, of luminance; zero: no answer
  Eigen::Array3d albedo = Eigen::Array3d::Zero();
  double residual = 0.0;
  double uncertainty_deg = 0.0;
  double albedo_uncertainty = 0.0;
  double misfit = 0.0;  // rung 1 alone
  int agreeing = 0;     // rung 2 alone
};

// Equations (1) to (5), with s = 1, from N^0 of least squares.
[[nodiscard]] PlainAnswer PlainWeighted(const PixelSystem& system, const StackNoise& noise);
// Equations (6) to (11); no answer where the samples that count have lights whose condition number is
// above max_condition.
[[nodiscard]] PlainAnswer PlainConsensus(const PixelSystem& system, double max_condition);

// Marks the pixels of this reason in `misfits`, one for each pixel of the rows, for
// WeighRowsInDouble to find.
void MarkPending(Reason which, int row_begin, int row_end, const NormalField& field,
                 std::span<float> misfits);
// PlainWeighted for the marked pixels that are solved by now; uncertainties times noise_scale.
void WeighRowsInDouble(const LightStack& stack, const Rig& rig, const LambertianOptions& options,
                       const StackNoise& noise, double noise_scale, int row_begin, int row_end,
                       NormalField& field, std::span<float> misfits);

}  // namespace sateen
