#include "solver/lambertian.h"

#include <vector>

#include "core/option_range.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "solver/least_squares/fast_rows.h"
#include "solver/least_squares/least_squares.h"

namespace sateen {
namespace {

Status SolveAllRows(const LeastSquaresRows& rows, const Task& task, NormalField& field) {
  const ImageSize size = field.reason.Size();
  // One per piece, at the index of its first row, so that they are added in order.
  std::vector<SolveSummary> pieces(static_cast<size_t>(size.height));
  task.BeginStage("solving", size.height);
  Status status = ParallelFor(size.height, RowsPerPiece(size), task, [&](int begin, int end) {
    rows.Solve(begin, end, field, pieces[static_cast<size_t>(begin)]);
  });
  for (const SolveSummary& piece : pieces) {
    AddCounts(piece, field.summary);
  }
  return status;
}

}  // namespace

Status LambertianOptions::Validate() const {
  if (!(shadow_level >= 0.0 && shadow_level < 1.0)) {
    return OutOfRange("shadow_level", shadow_level, "0 <= shadow_level < 1");
  }
  if (!(clip_level > 0.0 && clip_level <= 1.0)) {
    return OutOfRange("clip_level", clip_level, "0 < clip_level <= 1");
  }
  if (!(dark_level >= 0.0 && dark_level < 1.0)) {
    return OutOfRange("dark_level", dark_level, "0 <= dark_level < 1");
  }
  if (!(max_condition >= 2.0 && max_condition <= 1e6)) {
    return OutOfRange("max_condition", max_condition, "2 <= max_condition <= 1e6");
  }
  return {};
}

Status SolveLambertianInto(const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                           const LambertianOptions& options, const Task& task, NormalField& field,
                           const std::optional<Image<float>>& height_mm) {
  const Stopwatch stopwatch;
  Result<LeastSquaresRows> rows =
      LeastSquaresRows::Make({stack, rig, mask, height_mm}, options, nullptr);
  if (!rows) {
    return tl::unexpected(rows.error());
  }
  field.Resize(stack[0].rgb.Size());
  field.summary = {};
  if (Status status = SolveAllRows(*rows, task, field); !status) {
    return status;
  }
  FinishSummary(options, task, field.summary);
  field.summary.seconds = stopwatch.Seconds();
  return {};
}

Result<NormalField> SolveLambertian(const LightStack& stack, const Rig& rig,
                                    const std::optional<Mask>& mask,
                                    const LambertianOptions& options, const Task& task,
                                    const std::optional<Image<float>>& height_mm) {
  NormalField field;
  if (Status status = SolveLambertianInto(stack, rig, mask, options, task, field, height_mm);
      !status) {
    return tl::unexpected(status.error());
  }
  return field;
}

}  // namespace sateen
