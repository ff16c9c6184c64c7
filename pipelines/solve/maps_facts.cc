#include "pipelines/solve/maps_facts.h"

#include "pipelines/solve/solve.h"
#include "rig/pixel_pitch.h"

namespace sateen {

std::string_view Name(NormalY normal_y) { return normal_y == NormalY::kUp ? "up" : "down"; }

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
