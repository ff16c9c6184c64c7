#include "pipelines/solve/maps_facts.h"

#include "rig/pixel_pitch.h"
#include "rig/projection.h"

namespace sateen {

MapsFacts MapsFactsOf(const SolveOptions& options, const Rig& rig) {
  MapsFacts facts{
      .normal_y = options.normal_y, .has_ladder = options.robust.has_value(), .camera = rig.camera};
  if (options.undistort && rig.camera) {
    facts.camera = PinholeOf(*rig.camera);
  }
  if (facts.camera) {
    facts.pixel_mm = PixelPitchMm(*facts.camera);
  }
  return facts;
}

}  // namespace sateen
