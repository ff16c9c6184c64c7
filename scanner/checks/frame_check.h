#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"
#include "rig/rig.h"
#include "scanner/checks/frame_registration.h"
#include "scanner/checks/signal_levels.h"
#include "scanner/devices/tethered_camera.h"
#include "scanner/sessions/block_means.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// What the checks of a capture ask for. Shares and changes are relative: 0.1 is 10 %.
struct FrameCheckOptions {
  // Largest share of a frame's sites that may saturate. (0, 1]
  double max_saturated = 0.001;
  // Least brightness of a light, of what the rig says against the other lights, to be on. (0, 1)
  double min_level = 0.3;
  // Most that a light may differ from that, where the rig's lights have been calibrated, and where
  // they are only known by the ruler. (0, 1)
  double max_level_change = 0.12;
  double max_rough_level_change = 0.5;
  // Another light explains a frame: its misfit is below this part of the own light's. (0, 1)
  double other_light_misfit = 0.4;
  // Most that the dark may change from first to last, of the lit frames' brightness. (0, 1)
  double max_ambient = 0.01;
  // Drift of the first light from which on it is a warning. (0, 1)
  double max_drift = 0.03;
  // How far the picture may have moved meanwhile. (0, 100] px
  double max_shift_px = 1.0;
  // Correlation of first frame and repeat below which shifts cannot be told. (0, 1)
  double min_shift_peak = 0.1;
  // Least share of the light that a shadow on part of one frame takes to be found. (0, 1)
  double min_shade = 0.1;
  // Most that an exposure in a file may differ from the camera's word. (0, 1)
  double max_exposure_error = 0.1;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// What the checks keep of a frame.
struct FrameLook {
  BlockMeans means;
  SignalLevels levels;
  // Middle of the picture for the shift (AddToMiddle).
  Image<float> middle;
};

struct PixelPlace {
  int x = 0;
  int y = 0;
};

// Where the first cell of the middle of a picture lies in it. [px]
[[nodiscard]] PixelPlace OriginOfMiddle(ImageSize size_px, ImageSize cells);

/// Adds the middle of a plane to one of radiance, made where it is empty: cells 2 sites apart, at most
/// 512 x 512 of them. Each is the mean of 4 x 4 sites by the weights 1, 3, 3, 1 along both sides, which
/// count every colour of a mosaic alike, and which let pass less of what is finer than the cells and
/// would not move with the picture; not finite where one of them is saturated.
void AddToMiddle(const Image<float>& plane, float saturation, double exposure,
                 Image<float>& middle);

/// Reads a frame and checks what can be told of it alone: it decodes, has the size of the rig's
/// camera, the exposure that the camera confirmed where the file says one, and is not clipped.
///
/// `settings`  as the camera has them
/// Errors      kIo; kBadData: what is wrong, and what to do
[[nodiscard]] Result<FrameLook> CheckFrame(const FrameFile& file, const Rig& rig,
                                           const ExposureSettings& settings, FrameRole role,
                                           const FrameCheckOptions& options);

enum class CaptureFaultKind { kDark, kLevel, kOtherLight, kAmbient, kMoved, kShaded };

struct CaptureFault {
  CaptureFaultKind kind = CaptureFaultKind::kDark;
  std::vector<std::size_t> lights;  // of the rig; empty: every frame is concerned
  std::string text;                 // what was found, and what to do
};

struct CaptureCheck {
  std::vector<CaptureFault> faults;
  std::vector<std::string> notes;  // what could not be told, and what is no fault
  std::vector<double> levels;      // of each light, of what the rig says, over their median
  double ambient = 0.0;            // change of the dark, of the lit frames' brightness
  double drift = 0.0;              // of the first light
  // Of each light's frame against the first light's, and of the repeat last; empty where they cannot
  // be told. What IsSignificant() of them goes into the session as shift_px.
  std::vector<Shift> shifts;
};

// The frames of a capture, in the roles that they have for the checks.
struct CaptureLooks {
  std::vector<const FrameLook*> lit;  // of each light of the rig
  const FrameLook* dark_first = nullptr;
  const FrameLook* dark_last = nullptr;
  const FrameLook* repeat = nullptr;  // of the first light
};

/// Whether the frames of a capture can be true, by comparing them with each other and with the rig:
///
///     s_kb = i_kb - dark_b,   E_kb = e_k (n . l_k) at the block's place on the table          (1)
///     level_k = sum_b s_kb / sum_b E_kb,  over its median                 (2)
///     q_kb = log s_kb - med_j log s_jb,   r_kb = log E_kb - med_j log E_jb                    (3)
///     misfit_kj = var_b (q_kb - r_jb)                                                         (4)
///
/// The median over lights in (3) takes the texture of a fabric out; it runs over the lights that are
/// on, so that lights that have changed places do not disturb it. A light that is off has a level
/// below min_level; two that are on together have one too high; lights that have changed places have
/// the least misfit at another light than their own, as little as other frames at theirs. Levels are
/// only checked of a rig whose lights have been calibrated, patterns only where the camera has a pose
/// and the lights are no distant ones.
/// The dark at the end against the dark at the start tells of ambient light, the first light again of
/// drift (its sum over blocks). All frames are laid over the first (RegisterFrames), and what lies on
/// one frame alone is looked for (FindShades), once the lights are those that the rig says.
[[nodiscard]] CaptureCheck CheckCapture(const Rig& rig, const CaptureLooks& looks,
                                        const FrameCheckOptions& options);

// Writes the shifts that are significant into the session's lit frames as shift_px, to 0.001 px.
void RecordShifts(const CaptureCheck& check, const Rig& rig, Session& session);

}  // namespace sateen
