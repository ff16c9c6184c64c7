#include "solver/lambertian.h"

#include <array>
#include <chrono>
#include <utility>
#include <vector>

#include "core/parallel.h"
#include "solver/least_squares/fast_rows.h"
#include "solver/least_squares/least_squares.h"

namespace sateen {
namespace {

constexpr std::array<std::pair<Backend, std::string_view>, 5> kBackendNames = {{
    {Backend::kJacobiSvd, "jacobi-svd"},
    {Backend::kQr, "qr"},
    {Backend::kLdlt, "ldlt"},
    {Backend::kFast, "fast"},
    {Backend::kAuto, "auto"},
}};

Status SolveAllRows(const LeastSquaresRows& rows, const Task& task, NormalField& field) {
  const ImageSize size = field.reason.Size();
  // One for each piece, at the place of its first row; summed up in order.
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

std::string_view Name(Backend backend) {
  for (const auto& [value, name] : kBackendNames) {
    if (value == backend) {
      return name;
    }
  }
  return "";
}

std::optional<Backend> BackendNamed(std::string_view name) {
  for (const auto& [value, backend_name] : kBackendNames) {
    if (backend_name == name) {
      return value;
    }
  }
  return std::nullopt;
}

Status LambertianOptions::Validate() const {
  const auto fail = [](std::string_view field, double value, std::string_view range) {
    return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", field, value, range);
  };
  if (!(shadow_level >= 0.0 && shadow_level < 1.0)) {
    return fail("shadow_level", shadow_level, "0 <= shadow_level < 1");
  }
  if (!(clip_level > 0.0 && clip_level <= 1.0)) {
    return fail("clip_level", clip_level, "0 < clip_level <= 1");
  }
  if (!(dark_level >= 0.0 && dark_level < 1.0)) {
    return fail("dark_level", dark_level, "0 <= dark_level < 1");
  }
  if (!(max_condition >= 2.0 && max_condition <= 1e6)) {
    return fail("max_condition", max_condition, "2 <= max_condition <= 1e6");
  }
  return {};
}

void NormalField::Resize(ImageSize size) {
  if (reason.Size() == size) {
    return;
  }
  normal = Image3(size);
  albedo = Image3(size);
  residual = Image<float>(size);
  samples = Image<uint8_t>(size);
  reason = Image<uint8_t>(size);
}

Status SolveLambertianInto(const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                           const LambertianOptions& options, const Task& task, NormalField& field) {
  const auto start = std::chrono::steady_clock::now();
  Result<LeastSquaresRows> rows = LeastSquaresRows::Make(stack, rig, mask, options, nullptr);
  if (!rows) {
    return tl::unexpected(rows.error());
  }
  field.Resize(stack[0].rgb.Size());
  field.uncertainty = {};
  field.albedo_uncertainty = {};
  field.model = {};
  field.summary = {};
  if (Status status = SolveAllRows(*rows, task, field); !status) {
    return status;
  }
  FinishSummary(options, task, field.summary);
  field.summary.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return {};
}

Result<NormalField> SolveLambertian(const LightStack& stack, const Rig& rig,
                                    const std::optional<Mask>& mask,
                                    const LambertianOptions& options, const Task& task) {
  NormalField field;
  if (Status status = SolveLambertianInto(stack, rig, mask, options, task, field); !status) {
    return tl::unexpected(status.error());
  }
  return field;
}

}  // namespace sateen
