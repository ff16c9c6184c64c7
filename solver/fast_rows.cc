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

KernelLight KernelLightOf(const Light& light, const LightFrame& frame, const SampleNoise& noise,
                          double flux_scale, const LambertianOptions& options) {
  const bool distant = light.model == LightModel::kDistant;
  const Eigen::Vector3f place = (distant ? light.direction : light.position_mm).cast<float>();
  const Eigen::Vector3f axis = light.axis.cast<float>();
  const Eigen::Vector3f inverse_flux =
      (light.flux_rgb * (distant ? 1.0 : 1e6) / flux_scale).cwiseInverse().cast<float>();
  KernelLight kernel_light{.model = light.model,
                           .place = {place.x(), place.y(), place.z()},
                           .axis = {axis.x(), axis.y(), axis.z()},
                           .anisotropy = static_cast<float>(light.anisotropy),
                           .inverse_flux = {inverse_flux.x(), inverse_flux.y(), inverse_flux.z()},
                           .clip = ClipThreshold(frame, options),
                           .dark = DarkThreshold(frame, options)};
  for (size_t c = 0; c < 3; ++c) {
    const auto f = static_cast<double>(kernel_light.inverse_flux[c]);
    kernel_light.shot[c] = static_cast<float>(f * noise.shot[c]);
    kernel_light.read_squared[c] = static_cast<float>(f * f * noise.read[c] * noise.read[c]);
  }
  return kernel_light;
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
                                const std::optional<Mask>& mask, const LambertianOptions& options,
                                const StackNoise* noise) {
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
    rows.params_.lights.push_back(KernelLightOf(
        rig.lights[k], stack[k], noise ? (*noise)[k] : SampleNoise{}, flux_scale, options));
  }
  return rows;
}

FastRows::RowGeometry FastRows::GeometryOf(int begin, int end) const {
  RowGeometry geometry;
  if (grid_) {
    const auto width = static_cast<size_t>((*stack_)[0].rgb[0].width);
    geometry.x_mm.resize(width * static_cast<size_t>(end - begin));
    geometry.y_mm.resize(geometry.x_mm.size());
    for (int row = begin; row < end; ++row) {
      const size_t start = width * static_cast<size_t>(row - begin);
      grid_->Row(row, std::span(geometry.x_mm).subspan(start, width),
                 std::span(geometry.y_mm).subspan(start, width));
    }
  }
  FillGains(begin, end, geometry.gains, geometry.places);
  return geometry;
}

void FastRows::Solve(int begin, int end, NormalField& field) const {
  Run(SolveSpan, begin, end, GeometryOf(begin, end), field, nullptr);
}

void FastRows::SolveWeighted(int begin, int end, NormalField& field, Image<float>& misfit) const {
  Run(SolveWeightedSpan, begin, end, GeometryOf(begin, end), field, &misfit);
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
  Run(TouchSpan, begin, end, {}, field, nullptr);
}

void FastRows::Run(SpanFunction function, int begin, int end, const RowGeometry& geometry,
                   NormalField& field, Image<float>* misfit) const {
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
            .x_mm = geometry.x_mm.empty() ? nullptr : geometry.x_mm.data(),
            .y_mm = geometry.y_mm.empty() ? nullptr : geometry.y_mm.data(),
            .inverse_gains = geometry.places.empty() ? nullptr : geometry.places.data(),
            .mask = *mask_ ? at(**mask_) : nullptr,
            .count = count},
           {.normal = {at(field.normal[0]), at(field.normal[1]), at(field.normal[2])},
            .albedo = {at(field.albedo[0]), at(field.albedo[1]), at(field.albedo[2])},
            .residual = at(field.residual),
            .samples = at(field.samples),
            .reason = at(field.reason),
            .uncertainty = misfit != nullptr ? at(field.uncertainty) : nullptr,
            .misfit = misfit != nullptr ? at(*misfit) : nullptr});
}

void FastRows::SolveConsensus(int begin, int end, std::span<const size_t> pixels,
                              NormalField& field, std::span<uint8_t> agreeing) const {
  const size_t first = field.reason.Index(0, begin);
  const size_t count = pixels.size();
  const RowGeometry geometry = GeometryOf(begin, end);
  // The listed pixels side by side, so that every lane of a vector has work.
  std::vector<float> gathered((4 * stack_->size() + 2) * count, 0.0F);
  size_t next = 0;
  const auto gather = [&](const float* from, size_t shift) -> const float* {
    float* const to = gathered.data() + next;
    next += count;
    for (size_t j = 0; from != nullptr && j < count; ++j) {
      to[j] = from[pixels[j] - shift];
    }
    return to;
  };
  std::vector<const float*> planes;
  std::vector<const float*> gains(stack_->size(), nullptr);
  for (size_t k = 0; k < stack_->size(); ++k) {
    for (const Image<float>& plane : (*stack_)[k].rgb.planes) {
      planes.push_back(gather(plane.pixels.data(), 0));
    }
    if (!geometry.places.empty() && geometry.places[k] != nullptr) {
      gains[k] = gather(geometry.places[k], first);
    }
  }
  const auto position = [&](const std::vector<float>& of_rows) {
    return gather(of_rows.empty() ? nullptr : of_rows.data(), first);
  };
  const KernelInput input{.planes = planes.data(),
                          .x_mm = position(geometry.x_mm),
                          .y_mm = position(geometry.y_mm),
                          .inverse_gains = gains.data(),
                          .count = count};
  std::vector<float> results(8 * count);
  std::vector<uint8_t> bytes(2 * count);
  const auto result = [&](size_t index) { return results.data() + index * count; };
  SolveConsensusSpan(params_, input,
                     {.normal = {result(0), result(1), result(2)},
                      .albedo = {result(3), result(4), result(5)},
                      .residual = result(6),
                      .samples = bytes.data(),
                      .reason = bytes.data() + count,
                      .uncertainty = result(7),
                      .agreeing = agreeing.data()});
  for (size_t j = 0; j < count; ++j) {
    if (bytes[count + j] != static_cast<uint8_t>(Reason::kSolved)) {
      agreeing[j] = 0;
      continue;
    }
    for (size_t c = 0; c < 3; ++c) {
      field.normal[c].pixels[pixels[j]] = result(c)[j];
      field.albedo[c].pixels[pixels[j]] = result(3 + c)[j];
    }
    field.residual.pixels[pixels[j]] = result(6)[j];
    field.uncertainty.pixels[pixels[j]] = result(7)[j];
  }
}

Status TouchAllRows(const FastRows& rows, ImageSize size, const Task& task, NormalField& field) {
  field.Resize(size);
  return ParallelFor(size.height, RowsPerPiece(size), task,
                     [&](int begin, int end) { rows.Touch(begin, end, field); });
}

}  // namespace sateen
