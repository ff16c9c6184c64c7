#pragma once

#include <cstddef>
#include <filesystem>
#include <future>

#include "core/error.h"
#include "imaging/exposure_settings.h"
#include "rig/rig.h"
#include "scanner/checks/frame_look.h"
#include "scanner/sessions/session.h"

namespace sateen {

// A frame that has arrived: another thread checks it (CheckFrame) and flushes it to the disk while
// the next one is taken. Its destructor waits for that thread.
class ArrivedFrame {
 public:
  // frame    its place in the plan
  // record   as it goes into the session, without the hash; its file is relative to `session`
  // path     where it was delivered
  ArrivedFrame(std::size_t frame, SessionFrame record, std::filesystem::path path,
               const std::filesystem::path& session, const Rig& rig,
               const FrameCheckOptions& checks);

  [[nodiscard]] std::size_t Frame() const { return frame_; }
  [[nodiscard]] const SessionFrame& Record() const { return record_; }
  [[nodiscard]] const std::filesystem::path& Path() const { return path_; }

  // Waits for the thread and returns what it found. Once.
  [[nodiscard]] Result<FrameLook> TakeLook() { return look_.get(); }

 private:
  std::size_t frame_;
  SessionFrame record_;
  std::filesystem::path path_;
  std::future<Result<FrameLook>> look_;
};

}  // namespace sateen
