#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/capture/arrived_frame.h"
#include "scanner/capture/capture_options.h"
#include "scanner/capture/capture_progress.h"
#include "scanner/capture/frame_taker.h"
#include "scanner/capture/session_store.h"
#include "scanner/checks/frame_look.h"

namespace sateen {

// Looks at the frames of a plan; absent where a frame is open, or was taken by an earlier run.
using FrameLooks = std::vector<std::optional<FrameLook>>;

/// Takes the open frames of a store's plan. While a frame is taken, the one before is checked and
/// flushed by another thread.
///
///     a frame is   by                                        and then
///     open         its turn                                  taken: recorded as begun
///     taken        a failure of board, camera or check       open, at most options.tries times
///     taken        saturation at an exposure given by hand   open; an error, no other try
///     taken        saturation of a light's first exposure    open; TakeOpenFrames() ends, since
///                  where exposures are found                 the light is brighter than they allow
///     taken        a check that passes                       done: moved into place and recorded
///
/// It borrows all its arguments, which outlive it.
class PlanTaker {
 public:
  PlanTaker(SessionStore& store, FrameLooks& looks, const CaptureOptions& options,
            FrameTaker& taker, CaptureProgress& progress);

  /// Returns the light that is too bright for the plan, by its index in the rig; nothing where all
  /// frames are done.
  ///
  /// Errors   as CaptureSession::Run()
  [[nodiscard]] Result<std::optional<std::size_t>> TakeOpenFrames();

 private:
  [[nodiscard]] Result<ArrivedFrame> Take(std::size_t frame, int attempt);
  [[nodiscard]] Status Settle(ArrivedFrame arrived);
  [[nodiscard]] Status CheckClipped(std::size_t frame, const SignalLevels& levels);
  [[nodiscard]] Status TakeAgain(Error error, std::size_t frame, int attempt);
  [[nodiscard]] Status Reject(std::size_t frame, const std::string& reason);
  [[nodiscard]] std::optional<std::size_t> LightOfFrame(std::size_t frame) const;
  [[nodiscard]] const SessionFrame& Planned(std::size_t frame) const {
    return store_.Record().plan[frame];
  }

  SessionStore& store_;
  FrameLooks& looks_;
  const CaptureOptions& options_;
  FrameTaker& taker_;
  CaptureProgress& progress_;
  bool is_clipped_ = false;              // the latest frame, at an exposure given by hand
  std::optional<std::size_t> brighter_;  // light that is too bright for the plan
};

}  // namespace sateen
