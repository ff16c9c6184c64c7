#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "imaging/exposure_settings.h"
#include "rig/rig.h"
#include "scanner/capture/capture_options.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// Settings that all frames of a capture share.
struct FrameSettings {
  double f_number = 8.0;
  double iso = 100.0;
  double level = 1.0;  // level of the light, (0, 1]
};

// A frame as the camera delivered it.
struct TakenFrame {
  std::filesystem::path path;
  ExposureSettings settings;  // as the camera had them
  double camera_s = 0.0;      // time of exposing and transferring
};

// Returns whether another try may succeed after an error of a frame or of its check.
[[nodiscard]] bool MayTryAgain(ErrorCode code);

/// Takes one frame at a time under one light alone (ExposeLit). It borrows board and camera, which
/// outlive it.
///
///     state   the camera's settings   Take()                    Recover()
///     unset   are not known           sets them -> set          -> unset
///     set     are those asked for     sets them if they differ  -> unset
///
/// A failed Take() leaves the state as it is; one that failed to set the camera leaves it unset.
/// After any failure all lights have been told to go off.
class FrameTaker {
 public:
  // Needs an open `camera`; the board is connected where it is not. Uses settle, margin, deadline
  // and keep_alive of `options`.
  FrameTaker(LightBoard& board, TetheredCamera& camera, const FrameSettings& settings,
             const CaptureOptions& options, const Task& task);

  /// Takes a frame into `folder`, which is removed first, with all in it, and made again. No light:
  /// a dark frame.
  ///
  /// Errors   as TetheredCamera::Configure() and ExposeLit()
  [[nodiscard]] Result<TakenFrame> Take(const std::optional<Light>& light, double exposure_s,
                                        const std::filesystem::path& folder);

  // Opens the camera again where `error` may have been its fault, kDevice or kTimeout. Fails with
  // both errors.
  [[nodiscard]] Status Recover(const Error& error);

  // Turns all lights off. Fails unless the board says that they are.
  [[nodiscard]] Status TurnOff();

  // Returns whether the latest failure needs a person, as a full memory card does.
  [[nodiscard]] bool NeedsAPerson() const { return camera_.NeedsAPerson(); }

  // Returns the longest exposure for which the board lets every light of the rig be on. [s]
  [[nodiscard]] Result<double> LongestExposureOf(const std::vector<Light>& lights);

  [[nodiscard]] std::vector<double> ExposureTimes() const { return camera_.ExposureTimes(); }

 private:
  [[nodiscard]] Result<ExposureSettings> Configure(double exposure_s);

  LightBoard& board_;
  TetheredCamera& camera_;
  FrameSettings settings_;
  CaptureOptions options_;
  const Task& task_;
  struct Configured {
    double asked_s = 0.0;
    ExposureSettings settings;  // as the camera has them
  };
  std::optional<Configured> configured_;  // absent: unset
};

}  // namespace sateen
