#pragma once

#include <map>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/task.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// Noise of a reading [DN]: variance = gain_dn (reading - black) + read_dn^2 + 1/12, the last term
// from rounding.
struct SensorNoise {
  double gain_dn = 0.0;
  double read_dn = 0.0;
  std::string source;  // for messages: "the rig", or the repeated frame's file
  std::map<std::string, std::string> sha256_of_input = {};  // file of the repeat
};

/// Finds the noise of a dataset's readings: that of the rig's response; without one, measured on a
/// light's frame a, its repeat b and the first and last dark frame, tile by tile of 32 x 16 sites:
///
///     variance = 1/2 var(a - b - beta (a + b)),  beta by least squares in the tile            (1)
///
/// so that neither the cloth nor a drifting light is in it. The medians of tiles that are about
/// equally bright go to FitPhotonTransfer() of calibration/response/photon_transfer.h, but, with a
/// dark pair, for those that hold half as much variance again as most: a part of the picture that
/// moved does no harm.
///
/// Returns  nothing where neither the rig nor a repeat tells, or the pair shows no noise that grows
///          with the brightness, as that of a simulation may not, or more than noise, as where the
///          cloth moved
/// Errors   as TakeRawReadings()
/// Cost     decodes two pairs of frames, and looks at 64 rows of tiles at most
[[nodiscard]] Result<std::optional<SensorNoise>> FindSensorNoise(const ReadPlan& plan,
                                                                 const Task& task = {});

}  // namespace sateen
