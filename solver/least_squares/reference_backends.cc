#include "solver/least_squares/reference_backends.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "core/linear_algebra.h"
#include "solver/least_squares/pixel_system.h"

namespace sateen {
namespace {

// N_r, N_g, N_b, N of equation (3) as columns, and the condition number of the l_k.
struct Solution {
  Eigen::Matrix<double, 3, 4> n;
  double condition = std::numeric_limits<double>::infinity();
};

// Textbook form: dynamic size, double, one decomposition per pixel.
struct JacobiSvd {
  static Solution Solve(const PixelSystem& system) {
    const SvdSolution solution = SolveBySvd(system.L(), system.Rhs());
    return {solution.x, solution.condition};
  }
};

struct Qr {
  static Solution Solve(const PixelSystem& system) {
    return {SolveByQr(system.L(), system.Rhs()),
            ConditionOfGram(system.L().transpose() * system.L())};
  }
};

struct Ldlt {
  static Solution Solve(const PixelSystem& system) {
    return {SolveNormalEquations(system.L(), Eigen::MatrixX4d(system.Rhs())),
            ConditionOfGram(system.L().transpose() * system.L())};
  }
};

void Store(const PixelSystem& system, const Solution& solution, size_t pixel, NormalField& field) {
  const Eigen::Vector3d b = solution.n.col(3);
  const Eigen::Vector3d n = b.stableNormalized();  // (4)
  for (size_t c = 0; c < 3; ++c) {
    const auto column = static_cast<Eigen::Index>(c);
    field.normal[c].pixels[pixel] = static_cast<float>(n[column]);
    field.albedo[c].pixels[pixel] = static_cast<float>(solution.n.col(column).stableNorm());
  }
  const double sum = (system.Rhs().col(3) - system.L() * b).stableNorm();
  field.residual.pixels[pixel] = static_cast<float>(sum / std::sqrt(system.Count()));
}

template <typename Method>
void SolveRows(const FramesInput& input, const LambertianOptions& options, Reason which,
               int row_begin, int row_end, NormalField& field) {
  PixelSystem system(input, options);
  for (int row = row_begin; row < row_end; ++row) {
    for (int column = 0; column < field.reason.width; ++column) {
      const size_t pixel = field.reason.Index(column, row);
      if (field.reason.pixels[pixel] != static_cast<uint8_t>(which)) {
        continue;
      }
      system.Gather(column, row);
      Reason reason = system.SampleReason();
      if (reason == Reason::kSolved) {
        const Solution solution = Method::Solve(system);
        if (solution.condition <= options.max_condition && solution.n.allFinite()) {
          Store(system, solution, pixel, field);
        } else {
          reason = Reason::kIllConditioned;
        }
      }
      field.samples.pixels[pixel] = static_cast<uint8_t>(std::min(system.Count(), 255));
      field.reason.pixels[pixel] = static_cast<uint8_t>(reason);
    }
  }
}

}  // namespace

void SolveRowsInDouble(const FramesInput& input, const LambertianOptions& options, Backend backend,
                       Reason which, int row_begin, int row_end, NormalField& field) {
  switch (backend) {
    case Backend::kJacobiSvd:
      return SolveRows<JacobiSvd>(input, options, which, row_begin, row_end, field);
    case Backend::kQr:
      return SolveRows<Qr>(input, options, which, row_begin, row_end, field);
    case Backend::kLdlt:
      return SolveRows<Ldlt>(input, options, which, row_begin, row_end, field);
    case Backend::kFast:
    case Backend::kAuto:
      break;
  }
  SATEEN_CHECK(false);
}

}  // namespace sateen
