#include "solver/fast_rows.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "solver/pixel_system.h"

namespace sateen {
namespace {

constexpr int kPixelsPerPiece = 1 << 13;

// Irradiance that the light's green flux gives at the table's origin, or phi itself.
double TypicalIrradiance(const Light& light) {
  const double distance_m =
      light.model == LightModel::kDistant ? 1.0 : light.position_mm.norm() / 1000.0;
  return light.flux_rgb.y() / (distance_m * distance_m);
}

// The power of two next to the lights' geometric mean: fluxes come in any unit.
double FluxScale(const Lights& lights) {
  double sum = 0.0;
  for (const Light& light : lights) {
    sum += std::log2(TypicalIrradiance(light));
  }
  return std::exp2(std::round(sum / static_cast<double>(lights.size())));
}

bool HasField(const Light& light) { return light.model == LightModel::kLedField; }

KernelLight KernelLightOf(const Light& light, const LightFrame& frame, double flux_scale,
                          const LambertianOptions& options) {
  const bool distant = light.model == LightModel::kDistant;
  const Eigen::Vector3f place = (distant ? light.direction : light.position_mm).cast<float>();
  const Eigen::Vector3f axis = light.axis.cast<float>();
  const Eigen::Vector3f inverse_flux =
      (light.flux_rgb * (distant ? 1.0 : 1e6) / flux_scale).cwiseInverse().cast<float>();
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
  if (std::ranges::any_of(rig.lights, HasField)) {
    Result<GainRows> gains = GainRows::Make(*rig.camera, rig.lights);
    if (!gains) {
      return tl::unexpected(gains.error());
    }
    rows.gains_ = std::move(*gains);
  }
  rows.params_.shadow_level = static_cast<float>(options.shadow_level);
  rows.params_.max_condition_squared = std::min(
      static_cast<float>(options.max_condition * options.max_condition), kFloatConditionSquared);
  const double flux_scale = FluxScale(rig.lights);
  rows.params_.result_scale = static_cast<float>(1.0 / flux_scale);
  for (size_t k = 0; k < stack.size(); ++k) {
    rows.params_.lights.push_back(KernelLightOf(rig.lights[k], stack[k], flux_scale, options));
  }
  return rows;
}

void FastRows::Solve(int begin, int end, NormalField& field) const {
  std::vector<float> x_mm;
  std::vector<float> y_mm;
  if (grid_) {
    const auto width = static_cast<size_t>(field.reason.width);
    x_mm.resize(width * static_cast<size_t>(end - begin));
    y_mm.resize(x_mm.size());
    for (int row = begin; row < end; ++row) {
      const size_t start = width * static_cast<size_t>(row - begin);
      grid_->Row(row, std::span(x_mm).subspan(start, width), std::span(y_mm).subspan(start, width));
    }
  }
  std::vector<float> gains;
  std::vector<const float*> places;
  FillGains(begin, end, gains, places);
  Run(SolveSpan, begin, end, x_mm, y_mm, places.empty() ? nullptr : places.data(), field);
}

void FastRows::FillGains(int begin, int end, std::vector<float>& gains,
                         std::vector<const float*>& places) const {
  if (!gains_) {
    return;
  }
  const auto width = static_cast<size_t>((*stack_)[0].rgb[0].width);
  const size_t pixels = width * static_cast<size_t>(end - begin);
  places.assign(stack_->size(), nullptr);
  gains.resize(pixels * places.size());
  for (size_t k = 0; k < places.size(); ++k) {
    if (!gains_->Has(k)) {
      continue;
    }
    const std::span<float> of_light = std::span(gains).subspan(k * pixels, pixels);
    for (int row = begin; row < end; ++row) {
      gains_->Row(k, row, of_light.subspan(width * static_cast<size_t>(row - begin), width));
    }
    places[k] = of_light.data();
  }
}

void FastRows::Touch(int begin, int end, NormalField& field) const {
  Run(TouchSpan, begin, end, {}, {}, nullptr, field);
}

void FastRows::Run(SpanFunction function, int begin, int end, std::span<const float> x_mm,
                   std::span<const float> y_mm, const float* const* inverse_gains,
                   NormalField& field) const {
  const size_t first = field.reason.Index(0, begin);
  const size_t count = field.reason.Index(0, end) - first;
  std::vector<const float*> planes;
  for (const LightFrame& frame : *stack_) {
    for (const Image<float>& plane : frame.rgb.planes) {
      planes.push_back(plane.pixels.data() + first);
    }
  }
  const auto at = [&](auto& image) { return image.pixels.data() + first; };
  function(params_,
           {.planes = planes.data(),
            .x_mm = x_mm.empty() ? nullptr : x_mm.data(),
            .y_mm = y_mm.empty() ? nullptr : y_mm.data(),
            .inverse_gains = inverse_gains,
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
