#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "rig/rig.h"
#include "scanner/capture/capture_options.h"
#include "scanner/capture/capture_progress.h"
#include "scanner/capture/frame_taker.h"
#include "scanner/capture/plan_taker.h"
#include "scanner/capture/session_store.h"
#include "scanner/checks/capture_check.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// Result of a complete capture.
struct CaptureSummary {
  Session session;
  CaptureCheck check;
  int taken = 0;                // frames of the session, in this run
  int kept = 0;                 // frames of earlier runs
  int rejected = 0;             // frames of this run that did not count
  double seconds = 0.0;         // this run
  double camera_seconds = 0.0;  // share of it for exposing and delivering the frames that arrived
};

/// Captures one session into a folder (SessionStore).
///
/// 1. Exposures that are not given are found by test frames of the brightest light (FindExposures),
///    and found again where a light turns out to be brighter.
/// 2. Each frame is taken under its light alone, checked by itself and recorded (PlanTaker).
/// 3. When all are there they are compared with each other (CheckCapture). A frame that cannot be
///    right is rejected, and taken again once where that may help.
///
/// Killed at any moment, with any file half written, the capture continues with Resume(): frames
/// that the journal says are done and whose hashes still hold are not taken again.
///
///     state of the store   Run()                                  Finish()
///     begun                plans, takes, checks -> complete       not legal
///     planned              takes what is open, checks -> complete not legal
///     complete             not legal                              checks; writes session.json if
///                                                                 it is missing
///
/// An error leaves the store begun or planned, so that Resume() continues. Its message says
/// so once.
///
/// Errors   kInvalidArgument: options; a folder that holds a session
///          kBadData: rig or journal; a frame that fails its checks as often as it is tried, or
///          that is clipped at an exposure given by hand, which is not tried again
///          kDevice, kTimeout: board or camera, after all tries; kIo: the disk; kCancelled
/// After any error, and at the end of its life, all lights have been told to go off.
class CaptureSession {
 public:
  // Creates the folder and begins its journal (SessionStore::Begin).
  [[nodiscard]] static Result<CaptureSession> Begin(const std::filesystem::path& dir,
                                                    const std::filesystem::path& rig_file,
                                                    const CaptureOptions& options);
  // Continues the capture in `dir`. Kind, exposure and level are the journal's, not those of
  // `options`.
  [[nodiscard]] static Result<CaptureSession> Resume(const std::filesystem::path& dir,
                                                     const CaptureOptions& options);
  // Makes Run() take every frame again at this exposure, or at one that it finds. Later runs keep
  // that exposure.
  // kInvalidArgument: the session is complete.
  [[nodiscard]] Status ChangeExposure(std::optional<double> exposure_s);

  [[nodiscard]] const Journal& Record() const { return store_.Record(); }
  [[nodiscard]] const Rig& GetRig() const { return store_.GetRig(); }
  // Returns the exposure given by hand; nothing where it is found.
  [[nodiscard]] std::optional<double> AskedExposure() const;
  // Adds the command that continues the capture, where there is one and the error does not name it.
  [[nodiscard]] Error WithNextStep(Error error) const;
  // Returns the frames of the plan that are still to be taken.
  [[nodiscard]] std::vector<std::size_t> Open() const { return store_.Open(); }

  // `camera` is open. Connects the board where it is not.
  [[nodiscard]] Result<CaptureSummary> Run(LightBoard& board, TetheredCamera& camera,
                                           const Task& task, const CaptureObserver& observer = {});
  // Checks the frames of a complete journal without devices. Writes session.json if it is missing.
  [[nodiscard]] Result<CaptureSummary> Finish();

 private:
  CaptureSession(SessionStore store, const CaptureOptions& options);

  // Returns the error of a cancelled capture, once the board was asked whether all lights are off.
  [[nodiscard]] Error Cancelled(FrameTaker& taker) const;
  [[nodiscard]] Result<CaptureSummary> TakeAndCheck(FrameTaker& taker);
  [[nodiscard]] Status MakePlan(FrameTaker& taker);
  [[nodiscard]] Result<std::vector<double>> Meter(std::size_t light, FrameTaker& taker);
  [[nodiscard]] Status TakeAll(FrameTaker& taker);
  [[nodiscard]] Status Reject(std::size_t frame, const std::string& reason);
  [[nodiscard]] Result<CaptureCheck> CheckAll();
  [[nodiscard]] Status LookAgain(std::size_t frame);
  [[nodiscard]] Status RejectFaults(const CaptureCheck& check);
  [[nodiscard]] CaptureSummary Summarize(CaptureCheck check) const;
  [[nodiscard]] Result<CaptureSummary> Complete(CaptureCheck check);

  SessionStore store_;
  CaptureOptions options_;
  struct AskedAnew {
    std::optional<double> exposure_s;
  };
  std::optional<AskedAnew> asked_anew_;  // until there is a plan for it
  FrameLooks looks_;                     // looks of done frames
  std::optional<std::size_t> brighter_;  // light that is too bright for the plan
  CaptureProgress progress_;
};

}  // namespace sateen
