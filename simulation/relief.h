#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/task.h"
#include "imaging/light_stack.h"
#include "rig/rig.h"

namespace sateen {

// Shapes whose normal is known in closed form at every pixel.
enum class ReliefShape {
  kFlat,   // the table plane
  kDome,   // normals of a spherical cap: tilted by max_slope at the edge of the inscribed circle,
           // outwards, and level outside of it
  kRipple  // normals of crossed sine waves, tilted by at most max_slope
};

[[nodiscard]] std::optional<ReliefShape> ReliefShapeNamed(std::string_view name);

// A sensor that rounds, saturates and has shot and read noise. Exposure is part of `full_scale`.
struct SensorModel {
  double full_scale = 1.0;     // radiance that reads as the largest number
  int bits = 14;               // 1 to 16
  double electrons = 60000.0;  // at full scale; variance of the shot noise = the mean
  double read_noise_electrons = 4.0;
};

struct ReliefScene {
  ReliefShape shape = ReliefShape::kDome;
  double max_slope_rad = 0.7;      // [0, pi/2)
  double ripple_period_px = 40.0;  // kRipple only, > 0
  // Albedo varies smoothly between these two, differently in each channel. (0, 1].
  double albedo_min = 0.3;
  double albedo_max = 0.8;
  std::optional<SensorModel> sensor;  // absent: exact, unlimited
  uint64_t seed = 1;                  // seed of the sensor's noise

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

struct RenderedRelief {
  LightStack stack;
  Image3 normal;  // unit, table frame
  Image3 albedo;
};

/// Renders equation (1) of solver/lambertian.h for relief so low that every point counts as lying
/// in the table plane: attached shadows, no cast shadows, no inter-reflection.
///
/// rig      lights of any rung; the camera gives each pixel its table point. Where all lights are
///          distant it may be absent, and `size` is the size of the image; otherwise they agree.
/// Errors   kInvalidArgument: an option out of range; kBadData: the rig; kCancelled
/// Cost     O(H W K); the same bits for any number of threads
[[nodiscard]] Result<RenderedRelief> RenderRelief(const ReliefScene& scene, const Rig& rig,
                                                  ImageSize size, const Task& task = {});

}  // namespace sateen
