#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "rig/rig.h"
#include "scanner/capture/capture_options.h"
#include "scanner/capture/journal.h"
#include "scanner/checks/capture_check.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// Where a capture is.
struct CaptureEvent {
  std::string stage;        // "metering", "capturing", "checking"
  std::size_t done = 0;     // frames that count
  std::size_t frames = 0;   // of the plan; 0 while it is not made
  std::string light;        // of the frame that is being taken; "dark" for none
  double exposure_s = 0.0;  // of that frame
  double peak = 0.0;  // of the latest frame that was looked at (scanner/checks/signal_levels.h)
  std::optional<double> left_s;  // time left
};

// Told of every change, from the thread of the capture.
using CaptureObserver = std::function<void(const CaptureEvent&)>;

// What a capture tells of itself when it is complete.
struct CaptureSummary {
  Session session;
  CaptureCheck check;
  int taken = 0;                // frames of the session, in this run
  int kept = 0;                 // frames of earlier runs
  int rejected = 0;             // frames of this run that did not count
  double seconds = 0.0;         // this run
  double camera_seconds = 0.0;  // of that, the camera exposed and delivered frames that arrived
};

// The dark, every light of the rig in its order at each exposure, the first light again at the first
// exposure, the dark again; the dark at the last, the longest.
[[nodiscard]] FramePlan PlanOf(const Rig& rig, const std::vector<double>& exposures_s);

/// One session on its way to the disk.
///
///     folder            what
///     rig.json          the rig as it was, byte for byte
///     journal.jsonl     what was done (scanner/capture/journal.h)
///     .sateen-incoming/ where the camera delivers; whatever is left there is removed
///     frames/           00-dark.dng, 01-led-0.dng ...: renamed from there when on the disk
///     session.json      last, when every frame is there and checked
///
/// Exposures that are not given are found by test frames of the brightest light
/// (scanner/capture/exposure_search.h), and found again where a light turns out to be brighter. A frame is
/// taken under its light alone (scanner/capture/lit_exposure.h). Then the file must hold together by itself
/// (CheckFrame), is flushed, renamed and recorded, while the next one is being taken. When all are
/// there they are checked against each other (CheckCapture): what cannot be right is rejected, and
/// taken again where that may help.
///
/// Killed at any moment, with any file half written, it goes on with Resume(): frames that the journal
/// says are done and whose hashes still hold are not taken again.
///
/// Errors   kInvalidArgument: options; a folder that holds a session
///          kBadData: rig or journal; a frame that fails its checks as often as it is tried, or that is
///          clipped at an exposure given by hand, which is not tried again
///          kDevice, kTimeout: board or camera, after all tries; kIo: the disk; kCancelled
/// What ends a capture says once how to go on with it.
/// After any error, and when this goes out of scope, all lights have been told to go off.
class CaptureSession {
 public:
  // Whether a capture could begin: options, rig, and a folder that holds nothing to lose. The rig.
  [[nodiscard]] static Result<Rig> CheckBegin(const std::filesystem::path& dir,
                                              const std::filesystem::path& rig_file,
                                              const CaptureOptions& options);
  // Makes the folder and begins its journal. A journal of a capture that has no frame yet is begun anew.
  [[nodiscard]] static Result<CaptureSession> Begin(const std::filesystem::path& dir,
                                                    const std::filesystem::path& rig_file,
                                                    const CaptureOptions& options);
  // Of `options` what the journal says is not used: kind, exposure, level.
  [[nodiscard]] static Result<CaptureSession> Resume(const std::filesystem::path& dir,
                                                     const CaptureOptions& options);
  // Whether Resume() could: what the journal says. Locks and changes nothing.
  [[nodiscard]] static Result<Journal> CheckResume(const std::filesystem::path& dir);
  // Run() takes every frame again: at this exposure, or at one that it finds. Later runs keep to it.
  // kInvalidArgument: the session is complete.
  [[nodiscard]] Status ChangeExposure(std::optional<double> exposure_s);
  [[nodiscard]] static Status CompleteSession(const std::filesystem::path& dir);  // that error

  [[nodiscard]] const Journal& Record() const { return journal_; }
  [[nodiscard]] const Rig& GetRig() const { return rig_; }
  // As given by hand; nothing: it is found.
  [[nodiscard]] std::optional<double> AskedExposure() const;
  // The error with the command that goes on, where there is one and it does not say so itself.
  [[nodiscard]] Error WithNextStep(Error error) const;
  // Frames of the plan that are still to be taken.
  [[nodiscard]] std::vector<std::size_t> Open() const;

  // `camera` is open. Connects the board where it is not.
  [[nodiscard]] Result<CaptureSummary> Run(LightBoard& board, TetheredCamera& camera,
                                           const Task& task, const CaptureObserver& observer = {});
  // Of a journal that is complete: needs no device. Writes session.json where it is missing.
  [[nodiscard]] Result<CaptureSummary> Finish();

 private:
  // What a capture is run with.
  struct Tools {
    LightBoard& board;
    TetheredCamera& camera;
    const Task& task;
    const CaptureObserver& observer;
  };
  // A frame that has arrived, while it is being looked at and flushed by another thread.
  struct Arrived {
    std::size_t frame = 0;
    SessionFrame record;
    std::filesystem::path path;
    std::future<Result<FrameLook>> look;
  };

  CaptureSession(std::filesystem::path dir, Rig rig, Journal journal, JournalWriter writer,
                 const CaptureOptions& options);

  [[nodiscard]] Result<CaptureSummary> TakeAndCheck(Tools& tools);
  [[nodiscard]] Status VerifyDone();
  [[nodiscard]] Status MakePlan(Tools& tools);
  [[nodiscard]] Result<std::vector<double>> Meter(std::size_t light, Tools& tools);
  [[nodiscard]] Result<SignalLevels> TakeTestFrame(const Light& light, double exposure_s,
                                                   Tools& tools);
  [[nodiscard]] Status Reopen(const Error& error, TetheredCamera& camera);
  [[nodiscard]] Status TakeAll(Tools& tools);
  [[nodiscard]] Status TakeOpenFrames(Tools& tools);
  [[nodiscard]] Result<Arrived> Shoot(std::size_t frame, int attempt, Tools& tools);
  [[nodiscard]] Status Settle(Arrived arrived, Tools& tools);
  [[nodiscard]] Status CheckClipped(std::size_t frame, const SignalLevels& levels);
  [[nodiscard]] Status Place(const Arrived& arrived, SessionFrame& record);
  [[nodiscard]] Status TakeAgain(Error error, std::size_t frame, int attempt, Tools& tools);
  [[nodiscard]] Result<ExposureSettings> Configure(double exposure_s, TetheredCamera& camera);
  [[nodiscard]] Status Reject(std::size_t frame, const std::string& reason);
  [[nodiscard]] Result<CaptureCheck> CheckAll();
  [[nodiscard]] Status RejectFaults(const CaptureCheck& check);
  [[nodiscard]] CaptureSummary Summarize(CaptureCheck check) const;
  [[nodiscard]] Result<CaptureSummary> Complete(CaptureCheck check);
  void RemoveOtherFrames() const;
  void Tell(const Tools& tools, const char* stage, const std::string& light,
            double exposure_s) const;

  [[nodiscard]] const Light* LightOf(std::size_t frame) const;
  [[nodiscard]] bool IsBase(std::size_t frame) const;
  [[nodiscard]] std::string NameOf(std::size_t frame) const;
  [[nodiscard]] FrameFile FileOf(const SessionFrame& frame) const;

  std::filesystem::path dir_;
  Rig rig_;
  Journal journal_;
  JournalWriter writer_;
  CaptureOptions options_;
  struct Configured {
    double asked_s = 0.0;
    ExposureSettings settings;  // as the camera has them
  };
  std::optional<Configured> configured_;
  struct AskedAnew {
    std::optional<double> exposure_s;
  };
  std::optional<AskedAnew> asked_anew_;  // until there is a plan for it
  bool is_clipped_ = false;  // the latest frame that failed, at an exposure given by hand
  std::vector<std::optional<FrameLook>> looks_;  // of done frames
  std::optional<std::size_t> brighter_;          // light that the exposures found are too long for
  double peak_ = 0.0;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  std::chrono::duration<double> camera_time_{};
  std::vector<bool> is_new_;  // done frames: taken in this run
  int settled_ = 0;           // frames of this run that counted, also if they were rejected later
  int rejected_ = 0;
};

// In a session's folder, while it is captured.
inline constexpr const char* kIncoming = ".sateen-incoming";

// The session that a complete journal tells of.
[[nodiscard]] Session SessionOf(const Journal& journal);

// What was found of a session on disk.
struct SessionProof {
  int files = 0;                    // that are as they were captured
  std::vector<std::string> faults;  // one sentence each, with what to do; none: it is whole
};

/// Proves a session on disk whole: session.json, journal and rig agree, each light of the rig has its
/// frame, and each file has the hash that was recorded. A session whose session.json names no journal,
/// and that has none, was made by no capture, and is proved by what it records.
///
/// Errors   kIo: there is no such folder; kCancelled
[[nodiscard]] Result<SessionProof> ProveSession(const std::filesystem::path& dir, const Task& task);

// The same where anything but a whole session is an error, kBadData: all faults, one a line. Returns
// how many files were hashed.
[[nodiscard]] Result<int> VerifySession(const std::filesystem::path& dir, const Task& task);

}  // namespace sateen
