#include "solver/least_squares/fast_rows.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "solver/least_squares/pixel_system.h"

namespace sateen {
namespace {

constexpr int kPixelsPerPiece = 1 << 13;

KernelLight KernelLightOf(const Light& light, const LightFrame& frame, const SampleNoise& noise,
                          double flux_scale, const LambertianOptions& options) {
  const bool is_distant = light.model == LightModel::kDistant;
  const Eigen::Vector3f inverse_flux =
      (light.flux_rgb * (is_distant ? 1.0 : 1e6) / flux_scale).cwiseInverse().cast<float>();
  KernelLight kernel_light{.lamp = KernelLampOf(light),
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

double TypicalIrradiance(const Light& light) {
  const double distance_m =
      light.model == LightModel::kDistant ? 1.0 : light.position_mm.norm() / 1000.0;
  return light.flux_rgb.y() / (distance_m * distance_m);
}

double FluxScale(const Lights& lights) {
  double sum = 0.0;
  for (const Light& light : lights) {
    sum += std::log2(TypicalIrradiance(light));
  }
  return std::exp2(std::round(sum / static_cast<double>(lights.size())));
}

int RowsPerPiece(ImageSize size) { return std::max(1, kPixelsPerPiece / size.width); }

Result<FastRows> FastRows::Make(const FramesInput& input, const LambertianOptions& options,
                                const StackNoise* noise) {
  Result<PixelLocator> locator = PixelLocator::Make(input.rig, input.height_mm);
  if (!locator) {
    return tl::unexpected(locator.error());
  }
  FastRows rows(input, *std::move(locator));
  const Lights& lights = input.rig.lights;
  rows.params_.shadow_level = static_cast<float>(options.shadow_level);
  rows.params_.max_condition_squared = std::min(
      static_cast<float>(options.max_condition * options.max_condition), kFloatConditionSquared);
  const double flux_scale = FluxScale(lights);
  rows.params_.result_scale = static_cast<float>(1.0 / flux_scale);
  for (size_t k = 0; k < lights.size(); ++k) {
    rows.params_.lights.push_back(KernelLightOf(
        lights[k], input.stack[k], noise ? (*noise)[k] : SampleNoise{}, flux_scale, options));
  }
  return rows;
}

PixelGeometry FastRows::GeometryOf(int begin, int end) const {
  PixelGeometry geometry;
  locator_.Locate(begin, end, geometry);
  return geometry;
}

void FastRows::Solve(int begin, int end, NormalField& field) const {
  Run(SolveSpan, begin, end, GeometryOf(begin, end), field, nullptr);
}

void FastRows::SolveWeighted(int begin, int end, const PixelGeometry& geometry, double noise_scale,
                             NormalField& field, std::span<float> misfits) const {
  Run(SolveWeightedSpan, begin, end, geometry, field, misfits.data(), noise_scale);
}

void FastRows::Run(SpanFunction function, int begin, int end, const PixelGeometry& geometry,
                   NormalField& field, float* misfits, double noise_scale) const {
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
            .z_mm = geometry.z_mm.empty() ? nullptr : geometry.z_mm.data(),
            .inverse_gains = geometry.places.empty() ? nullptr : geometry.places.data(),
            .mask = mask_ != nullptr ? at(*mask_) : nullptr,
            .count = count,
            .noise_scale = static_cast<float>(noise_scale)},
           {.normal = {at(field.normal[0]), at(field.normal[1]), at(field.normal[2])},
            .albedo = {at(field.albedo[0]), at(field.albedo[1]), at(field.albedo[2])},
            .residual = at(field.residual),
            .samples = at(field.samples),
            .reason = at(field.reason),
            .uncertainty = misfits != nullptr ? at(field.uncertainty) : nullptr,
            .albedo_uncertainty = misfits != nullptr ? at(field.albedo_uncertainty) : nullptr,
            .misfit = misfits,
            .model = misfits != nullptr ? at(field.model) : nullptr});
}

void ListedPixels::Append(const PixelGeometry& geometry, size_t first,
                          std::span<const size_t> more) {
  const auto append = [&](const float* from, std::vector<float>& to) {
    for (const size_t pixel : more) {
      to.push_back(from[pixel - first]);
    }
  };
  pixels.insert(pixels.end(), more.begin(), more.end());
  if (geometry.x_mm.empty()) {
    x_mm.resize(pixels.size(), 0.0F);
    y_mm.resize(pixels.size(), 0.0F);
  } else {
    append(geometry.x_mm.data(), x_mm);
    append(geometry.y_mm.data(), y_mm);
  }
  if (!geometry.z_mm.empty()) {
    append(geometry.z_mm.data(), z_mm);
  }
  gains.resize(geometry.places.size());
  for (size_t k = 0; k < gains.size(); ++k) {
    if (geometry.places[k] != nullptr) {
      append(geometry.places[k], gains[k]);
    }
  }
}

void FastRows::RunListed(SpanFunction function, const ListedPixels& listed, bool has_positions,
                         const KernelOutput& output) const {
  const size_t count = listed.pixels.size();
  std::vector<float> samples;
  samples.reserve(3 * stack_->size() * count);
  std::vector<const float*> planes;
  for (const LightFrame& frame : *stack_) {
    for (const Image<float>& plane : frame.rgb.planes) {
      planes.push_back(samples.data() + samples.size());
      for (const size_t pixel : listed.pixels) {
        samples.push_back(plane.pixels[pixel]);
      }
    }
  }
  std::vector<const float*> gains;
  for (const std::vector<float>& of_light : listed.gains) {
    gains.push_back(of_light.empty() ? nullptr : of_light.data());
  }
  function(params_,
           {.planes = planes.data(),
            .x_mm = has_positions ? listed.x_mm.data() : nullptr,
            .y_mm = has_positions ? listed.y_mm.data() : nullptr,
            .z_mm = listed.z_mm.empty() ? nullptr : listed.z_mm.data(),
            .inverse_gains = gains.empty() ? nullptr : gains.data(),
            .count = count},
           output);
}

void FastRows::MisfitsAt(std::span<const size_t> pixels, std::span<float> misfits,
                         std::span<uint8_t> samples, std::span<uint8_t> reasons) const {
  ListedPixels listed;
  const auto width = static_cast<size_t>((*stack_)[0].rgb[0].width);
  for (size_t begin = 0; begin < pixels.size();) {
    const size_t row = pixels[begin] / width;
    size_t end = begin;
    while (end < pixels.size() && pixels[end] / width == row) {
      ++end;
    }
    const auto v = static_cast<int>(row);
    listed.Append(GeometryOf(v, v + 1), row * width, pixels.subspan(begin, end - begin));
    begin = end;
  }
  std::vector<float> results(9 * pixels.size());
  std::vector<uint8_t> models(pixels.size());
  const auto result = [&](size_t index) { return results.data() + index * pixels.size(); };
  const bool has_positions = locator_.HasPositions();  // else the kernel for distant lights
  RunListed(SolveWeightedSpan, listed, has_positions,
            {.normal = {result(0), result(1), result(2)},
             .albedo = {result(3), result(4), result(5)},
             .residual = result(6),
             .samples = samples.data(),
             .reason = reasons.data(),
             .uncertainty = result(7),
             .albedo_uncertainty = result(8),
             .misfit = misfits.data(),
             .model = models.data()});
}

void FastRows::SolveConsensus(const ListedPixels& listed, NormalField& field,
                              std::span<uint8_t> agreeing) const {
  const size_t count = listed.pixels.size();
  std::vector<float> results(9 * count);
  std::vector<uint8_t> bytes(2 * count);
  const auto result = [&](size_t index) { return results.data() + index * count; };
  RunListed(SolveConsensusSpan, listed, true,
            {.normal = {result(0), result(1), result(2)},
             .albedo = {result(3), result(4), result(5)},
             .residual = result(6),
             .samples = bytes.data(),
             .reason = bytes.data() + count,
             .uncertainty = result(7),
             .albedo_uncertainty = result(8),
             .agreeing = agreeing.data()});
  for (size_t j = 0; j < count; ++j) {
    if (bytes[count + j] != static_cast<uint8_t>(Reason::kSolved)) {
      agreeing[j] = 0;
      continue;
    }
    const size_t pixel = listed.pixels[j];
    for (size_t c = 0; c < 3; ++c) {
      field.normal[c].pixels[pixel] = result(c)[j];
      field.albedo[c].pixels[pixel] = result(3 + c)[j];
    }
    field.residual.pixels[pixel] = result(6)[j];
    field.uncertainty.pixels[pixel] = result(7)[j];
    field.albedo_uncertainty.pixels[pixel] = result(8)[j];
  }
}

}  // namespace sateen
