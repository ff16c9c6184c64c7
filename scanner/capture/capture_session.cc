#include "scanner/capture/capture_session.h"

#include <algorithm>
#include <utility>

#include "scanner/capture/metering.h"
#include "scanner/capture/session_folder.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr int kRounds = 2;     // rounds of taking again what the checks reject
constexpr int kMostPlans = 3;  // because a light was brighter than the exposures found

}  // namespace

Result<CaptureSession> CaptureSession::Begin(const fs::path& dir, const fs::path& rig_file,
                                             const CaptureOptions& options) {
  return SessionStore::Begin(dir, rig_file, options).map([&](SessionStore store) {
    return CaptureSession(std::move(store), options);
  });
}

Result<CaptureSession> CaptureSession::Resume(const fs::path& dir, const CaptureOptions& options) {
  return options.Validate()
      .and_then([&] { return SessionStore::Resume(dir); })
      .map([&](SessionStore store) { return CaptureSession(std::move(store), options); });
}

CaptureSession::CaptureSession(SessionStore store, const CaptureOptions& options)
    : store_(std::move(store)), options_(options), looks_(store_.Record().done.size()) {}

Status CaptureSession::ChangeExposure(std::optional<double> exposure_s) {
  if (Record().complete) {
    return tl::unexpected(CompleteSessionError(store_.Folder()));
  }
  asked_anew_ = AskedAnew{exposure_s};
  return {};
}

std::optional<double> CaptureSession::AskedExposure() const {
  return asked_anew_ ? asked_anew_->exposure_s : Record().begun.exposure_s;
}

Error CaptureSession::WithNextStep(Error error) const {
  const std::string command = "sateen capture --resume";
  if (Record().complete || error.message.find(command) != std::string::npos) {
    return error;
  }
  if (Open().size() < Record().done.size()) {
    error.message += fmt::format("; then continue: {} {}", command, store_.Folder().string());
  } else if (error.code != ErrorCode::kInvalidArgument) {
    error.message += "; no frame is kept yet: then run the same command again";
  }
  return error;
}

Status CaptureSession::Reject(std::size_t frame, const std::string& reason) {
  looks_[frame].reset();
  return store_.RejectFrame(frame, reason);
}

Result<std::vector<double>> CaptureSession::Meter(std::size_t light, FrameTaker& taker) {
  const MeteringObserver observer = {
      .on_test =
          [&](double exposure_s) {
            progress_.Tell(store_, "metering", GetRig().lights[light].name, exposure_s);
          },
      .on_levels = [&](const SignalLevels& levels) { progress_.SetPeak(levels.peak); }};
  return FindExposures(
      GetRig(), light,
      {.kind = Record().begun.kind, .brackets = Record().begun.brackets, .tries = options_.tries},
      store_.Incoming() / "test", taker, observer);
}

Status CaptureSession::MakePlan(FrameTaker& taker) {
  FramePlan plan;
  std::string reason;
  if (const std::optional<double> exposure_s = AskedExposure()) {
    plan = PlanOf(GetRig(), {*exposure_s});
    reason = "exposure as asked";
  } else {
    const std::size_t light = brighter_.value_or(BrightestLight(GetRig()));
    const Result<std::vector<double>> exposures_s = Meter(light, taker);
    if (!exposures_s) {
      return tl::unexpected(exposures_s.error());
    }
    plan = PlanOf(GetRig(), *exposures_s);
    reason = fmt::format("exposure found with light '{}'", GetRig().lights[light].name);
  }
  brighter_.reset();
  PlannedExposure asked;
  if (asked_anew_) {
    asked = {.is_new = true, .exposure_s = asked_anew_->exposure_s};
  }
  return store_.SetPlan(std::move(plan), reason, asked).map([&] {
    asked_anew_.reset();
    looks_.assign(Record().plan.size(), std::nullopt);
  });
}

Status CaptureSession::TakeAll(FrameTaker& taker) {
  for (int plans = 0; Record().plan.empty() || asked_anew_ || !Open().empty();) {
    if (Record().plan.empty() || asked_anew_ || brighter_) {
      if (plans++ == kMostPlans) {
        return Fail(ErrorCode::kBadData,
                    "light '{}' is too bright for every exposure that was found; do the lights "
                    "flicker? Or give --exposure",
                    GetRig().lights[brighter_.value_or(0)].name);
      }
      if (Status planned = MakePlan(taker); !planned) {
        return planned;
      }
    }
    Result<std::optional<std::size_t>> brighter =
        PlanTaker(store_, looks_, options_, taker, progress_).TakeOpenFrames();
    if (!brighter) {
      return tl::unexpected(brighter.error());
    }
    brighter_ = *brighter;
  }
  return {};
}

// Looks again at a frame of an earlier run. A frame that fails is open again.
Status CaptureSession::LookAgain(std::size_t frame) {
  const SessionFrame& done = *Record().done[frame];
  Result<FrameLook> look = CheckFrame(store_.FileOf(done), GetRig(),
                                      {.exposure_s = *done.exposure_s}, done.role, options_.checks);
  if (look) {
    looks_[frame] = *std::move(look);
    return {};
  }
  const bool is_bad = look.error().code == ErrorCode::kBadData && !Record().complete;
  const Status rejected = is_bad ? Reject(frame, look.error().message) : Status();
  return tl::unexpected(rejected ? look.error() : rejected.error());
}

Result<CaptureCheck> CaptureSession::CheckAll() {
  CaptureLooks looks;
  bool has_first_dark = false;
  for (std::size_t frame = 0; frame < looks_.size(); ++frame) {
    if (!IsFirstExposure(Record().plan, frame)) {
      continue;  // the same light as the frame before
    }
    if (const Status looked = looks_[frame] ? Status() : LookAgain(frame); !looked) {
      return tl::unexpected(looked.error());
    }
    const FrameLook& look = *looks_[frame];
    const FrameRole role = Record().plan[frame].role;
    if (role == FrameRole::kLit) {
      looks.lit.push_back(look);
    } else if (role == FrameRole::kRepeat) {
      looks.repeat = look;
    } else {
      (has_first_dark ? looks.dark_last : looks.dark_first) = look;
      has_first_dark = true;
    }
  }
  return CheckCapture(GetRig(), looks, options_.checks);
}

Status CaptureSession::RejectFaults(const CaptureCheck& check) {
  for (const CaptureFault& fault : check.faults) {
    for (std::size_t frame = 0; frame < Record().done.size(); ++frame) {
      const SessionFrame& planned = Record().plan[frame];
      const bool has_fault =
          fault.lights.empty() ||
          (planned.role == FrameRole::kLit && std::ranges::any_of(fault.lights, [&](std::size_t k) {
             return k == LightOf(GetRig(), planned);
           }));
      if (has_fault && Record().done[frame]) {
        if (Status rejected = Reject(frame, fault.text); !rejected) {
          return rejected;
        }
      }
    }
  }
  return {};
}

CaptureSummary CaptureSession::Summarize(CaptureCheck check) const {
  return {.check = std::move(check),
          .taken = store_.Taken(),
          .kept = static_cast<int>(Record().done.size()) - store_.Taken(),
          .rejected = store_.Rejected(),
          .seconds = progress_.Seconds(),
          .camera_seconds = progress_.CameraSeconds()};
}

Result<CaptureSummary> CaptureSession::Complete(CaptureCheck check) {
  CaptureSummary summary = Summarize(std::move(check));
  summary.session = SessionOf(Record());
  RecordShifts(summary.check, GetRig(), summary.session);
  return store_.Complete(summary.session).map([&] { return std::move(summary); });
}

Result<CaptureSummary> CaptureSession::Finish() {
  Result<CaptureCheck> check = store_.VerifyDone().and_then([&] { return CheckAll(); });
  if (!check) {
    return tl::unexpected(check.error());
  }
  if (!store_.HasSessionJson()) {
    return Complete(*std::move(check));
  }
  return ReadSessionRecord(store_.Folder()).map([&](const Session& session) {
    CaptureSummary summary = Summarize(*std::move(check));
    summary.session = session;
    return summary;
  });
}

Result<CaptureSummary> CaptureSession::Run(LightBoard& board, TetheredCamera& camera,
                                           const Task& task, const CaptureObserver& observer) {
  progress_.SetObserver(observer);
  const JournalBegun& begun = Record().begun;
  FrameTaker taker(board, camera,
                   {.f_number = begun.f_number, .iso = begun.iso, .level = begun.level}, options_,
                   task);
  Result<CaptureSummary> summary = TakeAndCheck(taker);
  progress_.SetObserver({});
  if (!summary) {
    summary = tl::unexpected(WithNextStep(std::move(summary.error())));
  }
  return summary;
}

Error CaptureSession::Cancelled(FrameTaker& taker) const {
  const Status dark = taker.TurnOff();
  return {
      dark ? ErrorCode::kCancelled : dark.error().code,
      fmt::format("cancelled; {}, and what was captured is kept; to continue: sateen capture "
                  "--resume {}",
                  dark ? "the lights are off" : dark.error().message, store_.Folder().string())};
}

Result<CaptureSummary> CaptureSession::TakeAndCheck(FrameTaker& taker) {
  if (const Status verified = store_.VerifyDone(); !verified) {
    return tl::unexpected(verified.error());
  }
  for (int round = 1;; ++round) {
    if (const Status taken = TakeAll(taker); !taken) {
      return tl::unexpected(taken.error().code == ErrorCode::kCancelled ? Cancelled(taker)
                                                                        : taken.error());
    }
    progress_.Tell(store_, "checking");
    Result<CaptureCheck> check = CheckAll();
    if (!check) {
      return tl::unexpected(check.error());
    }
    if (check->faults.empty()) {
      return Complete(*std::move(check));
    }
    if (const Status rejected = RejectFaults(*check); !rejected) {
      return tl::unexpected(rejected.error());
    }
    // A light that missed its cue may keep it the next time; no other fault goes away by itself.
    const bool may_pass = std::ranges::all_of(check->faults, [](const CaptureFault& fault) {
      return fault.kind == CaptureFaultKind::kDark || fault.kind == CaptureFaultKind::kLevel ||
             fault.kind == CaptureFaultKind::kShaded;
    });
    if (!may_pass || round == kRounds) {
      std::string text;
      for (const CaptureFault& fault : check->faults) {
        text += (text.empty() ? "" : "\n  ") + fault.text;
      }
      return Fail(ErrorCode::kBadData, "{}\nfix this, then continue: sateen capture --resume {}",
                  text, store_.Folder().string());
    }
  }
}

}  // namespace sateen
