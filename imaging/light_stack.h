#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// One lit frame as linear radiance: dark-subtracted, exposure-normalised, 1 = what a perfect white
// diffuser shows that faces a light of irradiance 1.
struct LightFrame {
  Image3 rgb;
  // Radiance of the file's full scale (what saturates); infinite where nothing saturates.
  float full_scale = std::numeric_limits<float>::infinity();
  std::string name;  // for messages: the file it came from
  // Whether the samples are a camera RAW file's, so that a rig's gain and read noise are theirs.
  bool raw = false;
  // From several exposures, each pixel of other ones: noise is not that of one exposure.
  bool merged = false;
};

// The frames of a session, one for each light, in the order of the lights.
using LightStack = std::vector<LightFrame>;

}  // namespace sateen
