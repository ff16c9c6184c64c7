#include "solver/robust/interpolation.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/angle.h"
#include "core/parallel.h"
#include "solver/least_squares/fast_rows.h"

namespace sateen {
namespace {

constexpr auto kQuarterSquareDegree = static_cast<float>(0.25 * kDegPerRad * kDegPerRad);

// Returns |f(-1) - 2 f + f(+1)|^2 of the neighbours `step` apart.
template <typename At>
float SquaredBendAt(const NormalField& field, const At& f, size_t p, size_t step, bool has_before,
                    bool has_after) {
  const bool before = has_before && IsSolved(field, p - step);
  const bool after = has_after && IsSolved(field, p + step);
  if (before && after) {
    return (f(p - step) - 2.0F * f(p) + f(p + step)).squaredNorm();
  }
  return before  ? 4.0F * (f(p - step) - f(p)).squaredNorm()
         : after ? 4.0F * (f(p + step) - f(p)).squaredNorm()
                 : 0.0F;
}

}  // namespace

Status DoubtInterpolation(const Task& task, NormalField& field, PieceSummary& total) {
  const ImageSize size = field.reason.Size();
  const auto width = static_cast<size_t>(size.width);
  std::vector<PieceSummary> rows(static_cast<size_t>(size.height));
  const Task silent{.threads = task.threads, .cancel = task.cancel};
  const auto normal_at = [&](size_t p) {
    return Eigen::Vector3f(field.normal[0].pixels[p], field.normal[1].pixels[p],
                           field.normal[2].pixels[p]);
  };
  const auto albedo_at = [&](size_t p) { return Eigen::Matrix<float, 1, 1>(AlbedoAt(field, p)); };
  Status status = ParallelFor(size.height, RowsPerPiece(size), silent, [&](int begin, int end) {
    for (int row = begin; row < end; ++row) {
      PieceSummary& sums = rows[static_cast<size_t>(row)];
      for (size_t x = 0; x < width; ++x) {
        const size_t p = field.model.Index(0, row) + x;
        if (!IsSolved(field, p)) {
          continue;
        }
        const auto bend_of = [&](const auto& f) {
          return SquaredBendAt(field, f, p, 1, x > 0, x + 1 < width) +
                 SquaredBendAt(field, f, p, width, row > 0, row + 1 < size.height);
        };
        float& uncertainty = field.uncertainty.pixels[p];
        uncertainty = std::min(180.0F, std::sqrt(uncertainty * uncertainty +
                                                 kQuarterSquareDegree * bend_of(normal_at)));
        const float albedo = albedo_at(p).x();
        float& of_albedo = field.albedo_uncertainty.pixels[p];
        of_albedo = albedo > 0.0F
                        ? std::min(1.0F, std::sqrt(of_albedo * of_albedo +
                                                   0.25F * bend_of(albedo_at) / (albedo * albedo)))
                        : 1.0F;
        const auto rung = static_cast<Rung>(field.model.pixels[p]);
        double& sum = rung <= Rung::kUnchecked ? sums.least_squares_deg
                      : rung == Rung::kLobe    ? sums.lobe_deg
                                               : sums.robust_deg;
        sum += static_cast<double>(uncertainty);
      }
    }
  });
  total.least_squares_deg = total.robust_deg = total.lobe_deg = 0.0;
  for (const PieceSummary& row : rows) {
    total.least_squares_deg += row.least_squares_deg;
    total.robust_deg += row.robust_deg;
    total.lobe_deg += row.lobe_deg;
  }
  return status;
}

}  // namespace sateen
