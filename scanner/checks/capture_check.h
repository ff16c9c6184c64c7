#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "rig/rig.h"
#include "scanner/checks/frame_check_options.h"
#include "scanner/checks/frame_look.h"
#include "scanner/checks/frame_registration.h"
#include "scanner/sessions/session.h"

namespace sateen {

enum class CaptureFaultKind { kDark, kLevel, kOtherLight, kAmbient, kMoved, kShaded };

struct CaptureFault {
  CaptureFaultKind kind = CaptureFaultKind::kDark;
  std::vector<std::size_t> lights;  // lights of the rig; empty: every frame has the fault
  std::string text;                 // finding, and what to do
};

struct CaptureCheck {
  std::vector<CaptureFault> faults;
  std::vector<std::string> notes;  // checks that were not possible, findings that are no fault
  std::vector<double> levels;      // brightness of each light relative to the calibration
  double ambient = 0.0;            // change of the dark, relative to the lit frames' brightness
  double drift = 0.0;              // change of the first light's brightness, relative
  // Shift of each light's frame from the first light's, and of the repeat last; empty where there
  // is too little texture. Those that are significant go into the session as shift_px.
  std::vector<Shift> shifts;
};

// Frames of a capture by their roles in the checks.
struct CaptureLooks {
  std::vector<FrameLook> lit;  // one per light of the rig
  FrameLook dark_first;
  FrameLook dark_last;
  FrameLook repeat;  // second frame of the first light
};

/// Compares the frames of a capture with each other and with the rig:
///
///     s_kb = i_kb - dark_b,   E_kb = e_k (n . l_k) at the block's place on the table          (1)
///     level_k = sum_b s_kb / sum_b E_kb,  divided by the median over k                        (2)
///
/// * A light that is off has a level below min_level. Two that are on together have one too high.
/// * Lights that have changed places have the least misfit (LightPatterns) at another light than
///   their own, as little as other frames at theirs. Patterns are checked where the camera has a
///   pose and the lights are not distant.
/// * Levels are held to max_level_change where the rig's lights have been calibrated, else to
///   max_rough_level_change.
/// * The last dark frame less the first gives the change of ambient light, the first light's repeat
///   gives its drift.
/// * Where no fault was found so far, all frames are registered to the first (RegisterFrames), and
///   shadows on single frames are looked for (FindShades).
[[nodiscard]] CaptureCheck CheckCapture(const Rig& rig, const CaptureLooks& looks,
                                        const FrameCheckOptions& options);

// Writes significant shifts into the session's lit frames as shift_px, to 0.001 px.
void RecordShifts(const CaptureCheck& check, const Rig& rig, Session& session);

}  // namespace sateen
