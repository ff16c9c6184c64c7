#pragma once

#include "core/error.h"
#include "core/files/output_folder.h"
#include "core/task.h"
#include "pipelines/simulate/scene_file.h"

namespace sateen {

enum class FrameFormat { kRawDng, kLinearExr };

/// Renders a scene, frame by frame, into a session: frames, rig.json, truth/ (normal, albedo,
/// height, the share of light per light, the rig) and, last, session.json.
///
/// A RAW value is a fraction of full scale, and value / H is radiance (scanner/sessions/session.h).
/// So the fluxes of the session's rig are the scene's times 1 / (full_scale H), and nothing else of
/// the truth is scaled.
[[nodiscard]] Status StageSimulatedSession(const SceneFile& file, FrameFormat format,
                                           const Task& task, OutputFolder& folder);

}  // namespace sateen
