#include "solver/fast_rows.h"

#include <algorithm>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "solver/pixel_system.h"

namespace sateen {
namespace {

constexpr int kPixelsPerPiece = 1 << 13;

KernelLight KernelLightOf(const Light& light, const LightFrame& frame,
                          const LambertianOptions& options) {
  const bool distant = light.model == LightModel::kDistant;
  const Eigen::Vector3f place = (distant ? light.direction : light.position_mm).cast<float>();
  const Eigen::Vector3f axis = light.axis.cast<float>();
  const Eigen::Vector3f inverse_flux =
      (light.flux_rgb * (distant ? 1.0 : 1e6)).cwiseInverse().cast<float>();
  return {.model = light.model,
          .place = {place.x(), place.y(), place.z()},
          .axis = {axis.x(), axis.y(), axis.z()},
          .anisotropy = static_cast<float>(light.anisotropy),
          .inverse_flux = {inverse_flux.x(), inverse_flux.y(), inverse_flux.z()},
          .clip = ClipThreshold(frame, options),
          .dark = DarkThreshold(frame, options)};
}

}  // namespace

bool AllDistant(const Lights& lights) {
  return std::all_of(lights.begin(), lights.end(),
                     [](const Light& light) { return light.model == LightModel::kDistant; });
}

int RowsPerPiece(ImageSize size) { return std::max(1, kPixelsPerPiece / size.width); }

size_t BytesPerPixel(size_t light_count) {
  return (3 * light_count + 7) * sizeof(float) + 2 * sizeof(uint8_t);
}

Result<FastRows> FastRows::Make(const LightStack& stack, const Rig& rig,
                                const std::optional<Mask>& mask, const LambertianOptions& options) {
  FastRows rows(stack, mask);
  if (!AllDistant(rig.lights)) {
    Result<TableGrid> grid = TableGrid::Make(*rig.camera);
    if (!grid) {
      return tl::unexpected(grid.error());
    }
    rows.grid_ = std::move(*grid);
  }
  rows.params_.shadow_level = static_cast<float>(options.shadow_level);
  rows.params_.max_condition_squared = std::min(
      static_cast<float>(options.max_condition * options.max_condition), kFloatConditionSquared);
  for (size_t k = 0; k < stack.size(); ++k) {
    rows.params_.lights.push_back(KernelLightOf(rig.lights[k], stack[k], options));
  }
  return rows;
}

void FastRows::Run(SpanFunction function, int begin, int end, NormalField& field) const {
  const auto width = static_cast<size_t>(field.reason.width);
  const size_t first = field.reason.Index(0, begin);
  const size_t count = width * static_cast<size_t>(end - begin);
  std::vector<const float*> planes;
  for (const LightFrame& frame : *stack_) {
    for (const Image<float>& plane : frame.rgb.planes) {
      planes.push_back(plane.pixels.data() + first);
    }
  }
  std::vector<float> x_mm(grid_ ? count : 0);
  std::vector<float> y_mm(x_mm.size());
  for (size_t start = 0; start < x_mm.size(); start += width) {
    grid_->Row(begin + static_cast<int>(start / width), std::span(x_mm).subspan(start, width),
               std::span(y_mm).subspan(start, width));
  }
  const auto at = [&](auto& image) { return image.pixels.data() + first; };
  function(params_,
           {.planes = planes.data(),
            .x_mm = grid_ ? x_mm.data() : nullptr,
            .y_mm = grid_ ? y_mm.data() : nullptr,
            .mask = *mask_ ? at(**mask_) : nullptr,
            .count = count},
           {{at(field.normal[0]), at(field.normal[1]), at(field.normal[2])},
            {at(field.albedo[0]), at(field.albedo[1]), at(field.albedo[2])},
            at(field.residual),
            at(field.samples),
            at(field.reason)});
}

Status TouchAllRows(const FastRows& rows, ImageSize size, const Task& task, NormalField& field) {
  field.Resize(size);
  return ParallelFor(size.height, RowsPerPiece(size), task,
                     [&](int begin, int end) { rows.Touch(begin, end, field); });
}

}  // namespace sateen
