#include "pipelines/solve/evaluation.h"

#include <utility>

#include "rig/pixel_pitch.h"

namespace sateen {

Result<Evaluation> Evaluate(const NormalField& field, const Truth& truth,
                            const std::optional<Camera>& camera) {
  Image<float> map;
  const Result<ErrorStatistics> angle = AngularErrorDeg(field, truth.normal, &map);
  if (!angle) {
    return tl::unexpected(angle.error());
  }
  Evaluation evaluation;
  if (angle->count == 0) {
    return evaluation;
  }
  evaluation.angular_error_deg = *angle;
  evaluation.error_map_deg = std::move(map);
  if (const std::optional<double> pitch_mm = camera ? PixelPitchMm(*camera) : std::nullopt) {
    const Result<ErrorStatistics> slow = LowFrequencyErrorDeg(field, truth.normal, *pitch_mm);
    if (slow && slow->count > 0) {
      evaluation.low_frequency_error_deg = *slow;
    }
  }
  if (truth.albedo) {
    const Result<ErrorStatistics> albedo = RelativeAlbedoError(field, *truth.albedo);
    if (!albedo) {
      return tl::unexpected(albedo.error());
    }
    evaluation.albedo_error = *albedo;
  }
  return evaluation;
}

}  // namespace sateen
