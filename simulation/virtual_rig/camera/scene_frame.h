#pragma once

#include <vector>

#include "imaging/image.h"
#include "simulation/sensor.h"
#include "simulation/virtual_rig/camera/lit_scene.h"

namespace sateen {

// A shadow on the picture: a disc that keeps `factor` of its light.
struct PictureShade {
  double x_px = 0.0;
  double y_px = 0.0;
  double radius_px = 0.0;
  double factor = 0.0;

  friend bool operator==(const PictureShade&, const PictureShade&) = default;
};

// Everything that determines a frame of a scene.
struct FrameState {
  std::vector<double> shares;  // share of full light, per light of the scene; w_k below
  double ambient = 1.0;        // factor on the scene's; a below
  double exposure = 1.0;       // H / H_ref
  // By how much the picture has moved to the right and down.
  double shift_x_px = 0.0;
  double shift_y_px = 0.0;
  std::vector<PictureShade> shades;
};

/// Returns a frame of the scene as the sensor reads it. With the pictures v of LitScene, (1) there:
///
///     x = (H / H_ref) (sum_k w_k v_k + a v_ambient)                                          (1)
///     x' = x(p - shift), between the sites of one phase of the Bayer pattern bilinearly,
///          beyond the border as at the border; times the factor of each shade                (2)
///     DN = the sensor's reading of x', equations (2) to (4) of sensor.h                      (3)
///
/// Pictures of share 0 cost nothing. The noise of a site depends on its place and on all of
/// `state`, on nothing else: equal states are equal frames, and others are independent.
///
/// Cost     one thread; at 16 megapixels 0.08 s for a light and ambient light, 0.12 s where it is
///          shifted (build/release/bin/virtual_camera_bench)
/// `state.shares` has one for each light. `sensor` must be valid.
[[nodiscard]] Image<uint16_t> FrameOfScene(const LitScene& scene, const Sensor& sensor,
                                           const FrameState& state);

}  // namespace sateen
