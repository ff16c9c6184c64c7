#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "imaging/mosaic_stack.h"
#include "scanner/sessions/frames/sensor_noise.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// Readings of a dataset. The stack keeps them in memory, or in an unnamed file that is deleted with
// the stack.
struct LoadedMosaics {
  MosaicStack stack;
  std::map<std::string, std::string> sha256_of_input;
  std::optional<SensorNoise> noise;  // nothing: not known, or not asked for
};

// Returns why the frames cannot be solved from their mosaics; nothing where they can be.
[[nodiscard]] std::optional<std::string> WhyNoMosaics(const ReadPlan& plan);

// Limits of memory, in bytes.
struct MosaicMemory {
  std::uintmax_t readings = std::uintmax_t{256} << 20;  // beyond, they go to a file
  std::uintmax_t decoded = std::uintmax_t{640} << 20;   // at the same time, but one frame at least
};

/// Decodes the frames of a plan whose WhyNoMosaics() is nothing; `noise` is the same for all.
/// Readings beyond memory.readings go to a scratch file in `scratch_dir`, row by row as they are
/// decoded.
///
/// Errors  as LoadFrames(); kIo where the scratch file cannot be written, with the room it needs
[[nodiscard]] Result<LoadedMosaics> LoadMosaics(const ReadPlan& plan,
                                                const std::optional<SensorNoise>& noise,
                                                const std::filesystem::path& scratch_dir,
                                                const Task& task, const MosaicMemory& memory = {});

}  // namespace sateen
