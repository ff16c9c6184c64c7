#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/files/own_folder.h"
#include "rig/rig.h"
#include "scanner/capture/capture_options.h"
#include "scanner/capture/frame_plan.h"
#include "scanner/capture/journal.h"
#include "scanner/sessions/read_plan.h"
#include "scanner/sessions/session.h"

namespace sateen {

/// The folder of one session while it is captured, and its journal. What has been recorded is on
/// the disk when a function returns.
///
///     rig.json          the rig as it was, byte for byte
///     journal.jsonl     what was done (scanner/capture/journal.h)
///     .sateen-incoming-XXXXXX/
///                       where the camera delivers (OwnFolder); one that was left by a killed run
///                       is removed
///     frames/           00-dark.dng, 01-led-0.dng ...: renamed from there when on the disk. What the
///                       journal did not begin is not touched (scanner/capture/own_frames.h)
///     session.json      last, when every frame is there and checked
///
///     state      entered by                 legal
///     begun      Begin(), Resume()          SetPlan()
///     planned    SetPlan(), Resume()        SetPlan(), BeginFrame(), KeepFrame(), RejectFrame(),
///                                           VerifyDone(); Complete() if all frames are done
///     complete   Complete(), Resume()       VerifyDone(), Complete()
///
/// An error of the journal leaves the state as it was (JournalWriter).
class SessionStore {
 public:
  /// Creates the folder and begins its journal. A journal without any frame is begun again. Errors
  /// as CheckBegin(); kIo: another program has it locked.
  [[nodiscard]] static Result<SessionStore> Begin(const std::filesystem::path& dir,
                                                  const std::filesystem::path& rig_file,
                                                  const CaptureOptions& options);
  /// Continues the capture in `dir`. Errors as CheckResume(); kIo: another program has it locked.
  [[nodiscard]] static Result<SessionStore> Resume(const std::filesystem::path& dir);

  [[nodiscard]] const std::filesystem::path& Folder() const { return dir_; }
  // Returns the folder that the camera delivers into; until the session is complete.
  [[nodiscard]] const std::filesystem::path& Incoming() const;
  [[nodiscard]] const Rig& GetRig() const { return rig_; }
  [[nodiscard]] const Journal& Record() const { return journal_; }
  [[nodiscard]] FrameFile FileOf(const SessionFrame& frame) const;
  // Returns the frames of the plan that are still to be taken, in order.
  [[nodiscard]] std::vector<std::size_t> Open() const;
  // Counts the done frames that were taken by this object, and its RejectFrame() calls.
  [[nodiscard]] int Taken() const;
  [[nodiscard]] int Rejected() const { return rejected_; }

  // Records the plan; all its frames are open. A new exposure takes the place of the journal's.
  [[nodiscard]] Status SetPlan(FramePlan plan, const std::string& reason,
                               const PlannedExposure& exposure = {});
  // kInvalidArgument: a file that is not of this capture has the frame's place.
  [[nodiscard]] Status BeginFrame(std::size_t frame);
  // Moves the delivered file to where the record says, and records the frame as done.
  // kInvalidArgument: another file has the place.
  [[nodiscard]] Status KeepFrame(std::size_t frame, SessionFrame record,
                                 const std::filesystem::path& delivered);
  // Opens a frame that was begun or done again.
  [[nodiscard]] Status RejectFrame(std::size_t frame, const std::string& reason);
  // Rejects the done frames whose files have gone or changed. kIo, kBadData: the session is
  // complete.
  [[nodiscard]] Status VerifyDone();
  // Removes frames of earlier plans, names files that are not of this capture, completes the
  // journal and writes `session` to session.json.
  [[nodiscard]] Status Complete(const Session& session);
  [[nodiscard]] bool HasSessionJson() const;

 private:
  SessionStore(std::filesystem::path dir, Rig rig, Journal journal, JournalWriter writer,
               std::optional<OwnFolder> incoming);
  [[nodiscard]] Status Place(const std::filesystem::path& delivered,
                             const std::filesystem::path& place);

  std::filesystem::path dir_;
  Rig rig_;
  Journal journal_;
  JournalWriter writer_;
  std::optional<OwnFolder> incoming_;  // absent once the session is complete
  std::vector<bool> is_new_;           // [frame of the plan]: done, and taken by this object
  int rejected_ = 0;
};

// Returns the session of a journal whose frames are all done.
[[nodiscard]] Session SessionOf(const Journal& journal);

}  // namespace sateen
