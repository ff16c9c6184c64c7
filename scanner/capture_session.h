#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/task.h"
#include "rig/rig.h"
#include "scanner/capture_options.h"
#include "scanner/frame_check.h"
#include "scanner/journal.h"
#include "scanner/light_board.h"
#include "scanner/tethered_camera.h"

namespace sateen {

// What a capture tells of itself when it is complete.
struct CaptureSummary {
  Session session;
  CaptureCheck check;
  int taken = 0;     // frames, in this run
  int kept = 0;      // frames of earlier runs
  int rejected = 0;  // frames of this run that did not count
};

// The dark, every light of the rig in its order, the first light again, the dark again.
[[nodiscard]] FramePlan PlanOf(const Rig& rig);

/// One session on its way to the disk.
///
///     folder            what
///     rig.json          the rig as it was, byte for byte
///     journal.jsonl     what was done (scanner/journal.h)
///     incoming/         where the camera delivers; whatever is left there is removed
///     frames/           00-dark.dng, 01-led-0.dng ...: renamed from incoming/ when on the disk
///     session.json      last, when every frame is there and checked
///
/// A frame: its light on, and the board's word that it alone is; the camera's exposure; the board's
/// word that the light was on all the while; off. Then the file must hold together by itself
/// (CheckFrame), is flushed, renamed and recorded. When all are there they are checked against each
/// other (CheckCapture): what cannot be right is rejected, and taken again where that may help.
///
/// Killed at any moment, with any file half written, it goes on with Resume(): frames that the journal
/// says are done and whose hashes still hold are not taken again.
///
/// Errors   kInvalidArgument: options; a folder that holds a session
///          kBadData: rig or journal; a frame that fails its checks as often as it is tried
///          kDevice, kTimeout: board or camera, after all tries; kIo: the disk; kCancelled
/// After any error, and when this goes out of scope, all lights have been told to go off.
class CaptureSession {
 public:
  // Makes the folder and begins its journal.
  [[nodiscard]] static Result<CaptureSession> Begin(const std::filesystem::path& dir,
                                                    const std::filesystem::path& rig_file,
                                                    const CaptureOptions& options);
  // Of `options` what the journal says is not used: kind, settings, level.
  [[nodiscard]] static Result<CaptureSession> Resume(const std::filesystem::path& dir,
                                                     const CaptureOptions& options);

  [[nodiscard]] const JournalBegun& Plan() const { return journal_.begun; }
  [[nodiscard]] const Rig& GetRig() const { return rig_; }
  // Frames of the plan that are still to be taken.
  [[nodiscard]] std::vector<std::size_t> Open() const;

  // `camera` is open. Connects the board where it is not.
  [[nodiscard]] Result<CaptureSummary> Run(LightBoard& board, TetheredCamera& camera,
                                           const Task& task);

 private:
  CaptureSession(std::filesystem::path dir, Rig rig, Journal journal, JournalWriter writer,
                 const CaptureOptions& options);

  [[nodiscard]] Status VerifyDone();
  [[nodiscard]] Status TakeOpenFrames(LightBoard& board, TetheredCamera& camera, const Task& task);
  [[nodiscard]] Status TakeFrame(std::size_t frame, LightBoard& board, TetheredCamera& camera,
                                 const Task& task);
  [[nodiscard]] Result<SessionFrame> TryFrame(std::size_t frame, LightBoard& board,
                                              TetheredCamera& camera, const Task& task);
  [[nodiscard]] Result<SessionFrame> Accept(std::size_t frame, const CapturedFile& file);
  [[nodiscard]] Status Reject(std::size_t frame, const std::string& reason);
  [[nodiscard]] Result<CaptureCheck> CheckAll(const Task& task);
  [[nodiscard]] Status RejectFaults(const CaptureCheck& check);
  [[nodiscard]] Result<CaptureSummary> Complete(CaptureCheck check);

  [[nodiscard]] const Light* LightOf(std::size_t frame) const;
  [[nodiscard]] std::string NameOf(std::size_t frame) const;
  [[nodiscard]] FrameFile FileOf(const SessionFrame& frame) const;

  std::filesystem::path dir_;
  Rig rig_;
  Journal journal_;
  JournalWriter writer_;
  CaptureOptions options_;
  ExposureSettings settings_;                    // as the camera has them
  std::vector<std::optional<FrameLook>> looks_;  // of done frames
  int taken_ = 0;
  int rejected_ = 0;
};

// The session that a complete journal tells of.
[[nodiscard]] Session SessionOf(const Journal& journal);

/// Proves a session on disk whole: session.json, journal and rig agree, each light of the rig has its
/// frame, and each file has the hash that was recorded. A session without a journal, which no capture
/// made, is proved by what it records. Returns how many files were hashed.
///
/// Errors   kBadData, kIo: the first thing that is not so
[[nodiscard]] Result<int> VerifySession(const std::filesystem::path& dir, const Task& task);

}  // namespace sateen
