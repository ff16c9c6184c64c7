#include "scanner/capture/capture_session.h"

#include <algorithm>
#include <utility>

#include "core/check.h"
#include "core/output_folder.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/frame_loader.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRecordFile = "session.json";
constexpr int kRounds = 2;     // of taking again what the checks reject
constexpr int kMostPlans = 3;  // because a light was brighter than the exposures found

}  // namespace

FramePlan PlanOf(const Rig& rig, const std::vector<double>& exposures_s) {
  SATEEN_CHECK(!rig.lights.empty() && !exposures_s.empty());
  const SessionFrame dark = {.role = FrameRole::kDark, .exposure_s = exposures_s.back()};
  FramePlan plan = {dark};
  for (const Light& light : rig.lights) {
    for (const double exposure_s : exposures_s) {
      plan.push_back({.role = FrameRole::kLit, .light = light.name, .exposure_s = exposure_s});
    }
  }
  plan.push_back({.role = FrameRole::kRepeat,
                  .light = rig.lights.front().name,
                  .exposure_s = exposures_s.front()});
  plan.push_back(dark);
  return plan;
}

Session SessionOf(const Journal& journal) {
  Session session{.kind = journal.begun.kind,
                  .rig = journal.begun.rig,
                  .rig_sha256 = journal.begun.rig_sha256,
                  .has_journal = true};
  for (const std::optional<SessionFrame>& frame : journal.done) {
    SATEEN_CHECK(frame.has_value());
    session.frames.push_back(*frame);
  }
  return session;
}

CaptureSession::CaptureSession(fs::path dir, Rig rig, Journal journal, JournalWriter writer,
                               const CaptureOptions& options)
    : dir_(std::move(dir)),
      rig_(std::move(rig)),
      journal_(std::move(journal)),
      writer_(std::move(writer)),
      options_(options),
      looks_(journal_.done.size()),
      is_new_(journal_.done.size()) {}

std::optional<double> CaptureSession::AskedExposure() const {
  return asked_anew_ ? asked_anew_->exposure_s : journal_.begun.exposure_s;
}

Error CaptureSession::WithNextStep(Error error) const {
  const std::string command = "sateen capture --resume";
  if (journal_.complete || error.message.find(command) != std::string::npos) {
    return error;
  }
  if (Open().size() < journal_.done.size()) {
    error.message += fmt::format("; then go on: {} {}", command, dir_.string());
  } else if (error.code != ErrorCode::kInvalidArgument) {
    error.message += "; no frame is kept yet: then give the same command again";
  }
  return error;
}

std::vector<std::size_t> CaptureSession::Open() const {
  std::vector<std::size_t> open;
  for (std::size_t frame = 0; frame < journal_.done.size(); ++frame) {
    if (!journal_.done[frame]) {
      open.push_back(frame);
    }
  }
  return open;
}

const Light* CaptureSession::LightOf(std::size_t frame) const {
  const auto light = std::ranges::find(rig_.lights, journal_.plan[frame].light, &Light::name);
  return light == rig_.lights.end() ? nullptr : &*light;
}

// Of the light's first exposure, which holds its bright parts; or a dark frame.
bool CaptureSession::IsBase(std::size_t frame) const {
  return frame == 0 || journal_.plan[frame].role != FrameRole::kLit ||
         journal_.plan[frame - 1].light != journal_.plan[frame].light;
}

std::string CaptureSession::NameOf(std::size_t frame) const {
  const SessionFrame& planned = journal_.plan[frame];
  return planned.role == FrameRole::kDark  ? "dark"
         : planned.role == FrameRole::kLit ? planned.light
                                           : planned.light + " again";
}

FrameFile CaptureSession::FileOf(const SessionFrame& frame) const {
  return {dir_ / frame.file, frame.Exposure(), frame.sha256, rig_.response};
}

Status CaptureSession::Reject(std::size_t frame, const std::string& reason) {
  journal_.done[frame].reset();
  looks_[frame].reset();
  is_new_[frame] = false;
  ++rejected_;
  return writer_.FrameRejected(frame, reason);
}

// Frames whose files have gone or changed since are taken again.
Status CaptureSession::VerifyDone() {
  for (std::size_t frame = 0; frame < journal_.done.size(); ++frame) {
    if (!journal_.done[frame]) {
      continue;
    }
    if (const Result<std::string> hash = CheckedHash(FileOf(*journal_.done[frame])); !hash) {
      if (journal_.complete) {
        return Fail(hash.error().code,
                    "{}\n{}: is a complete session, of which no frame is taken again; restore the "
                    "file, or capture anew into another folder",
                    hash.error().message, dir_.string());
      }
      if (Status rejected = Reject(frame, hash.error().message); !rejected) {
        return rejected;
      }
    }
  }
  return {};
}

void CaptureSession::Tell(const Tools& tools, const char* stage, const std::string& light,
                          double exposure_s) const {
  if (!tools.observer) {
    return;
  }
  CaptureEvent event{.stage = stage,
                     .done = journal_.done.size() - Open().size(),
                     .frames = journal_.done.size(),
                     .light = light,
                     .exposure_s = exposure_s,
                     .peak = peak_};
  if (settled_ > 0) {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - started_;
    event.left_s = spent.count() / settled_ * static_cast<double>(Open().size());
  }
  tools.observer(event);
}

Result<CaptureCheck> CaptureSession::CheckAll() {
  CaptureLooks looks;
  bool has_first_dark = false;
  for (std::size_t frame = 0; frame < looks_.size(); ++frame) {
    const SessionFrame& done = *journal_.done[frame];
    if (!IsBase(frame)) {
      continue;  // the same light as the frame before
    }
    if (!looks_[frame]) {  // of an earlier run
      Result<FrameLook> look = CheckFrame(FileOf(done), rig_, {.exposure_s = *done.exposure_s},
                                          done.role, options_.checks);
      if (!look) {
        // So that going on takes it again.
        const bool is_bad = look.error().code == ErrorCode::kBadData && !journal_.complete;
        const Status rejected = is_bad ? Reject(frame, look.error().message) : Status();
        return tl::unexpected(rejected ? look.error() : rejected.error());
      }
      looks_[frame] = *std::move(look);
    }
    const FrameLook& look = *looks_[frame];
    if (done.role == FrameRole::kLit) {
      looks.lit.push_back(look);
    } else if (done.role == FrameRole::kRepeat) {
      looks.repeat = look;
    } else {
      (has_first_dark ? looks.dark_last : looks.dark_first) = look;
      has_first_dark = true;
    }
  }
  return CheckCapture(rig_, looks, options_.checks);
}

Status CaptureSession::RejectFaults(const CaptureCheck& check) {
  for (const CaptureFault& fault : check.faults) {
    for (std::size_t frame = 0; frame < journal_.done.size(); ++frame) {
      const bool is_lit = journal_.plan[frame].role == FrameRole::kLit;
      const bool concerned =
          fault.lights.empty() || (is_lit && std::ranges::any_of(fault.lights, [&](std::size_t k) {
                                     return &rig_.lights[k] == LightOf(frame);
                                   }));
      if (concerned && journal_.done[frame]) {
        if (Status rejected = Reject(frame, fault.text); !rejected) {
          return rejected;
        }
      }
    }
  }
  return {};
}

CaptureSummary CaptureSession::Summarize(CaptureCheck check) const {
  CaptureSummary summary{.check = std::move(check), .rejected = rejected_};
  summary.taken = static_cast<int>(std::ranges::count(is_new_, true));
  summary.kept = static_cast<int>(journal_.done.size()) - summary.taken;
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - started_;
  summary.seconds = spent.count();
  summary.camera_seconds = camera_time_.count();
  return summary;
}

// Frames of an earlier plan, whose names were others.
void CaptureSession::RemoveOtherFrames() const {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(dir_ / "frames", ignored)) {
    const std::string file = (fs::path("frames") / entry.path().filename()).string();
    const bool is_ours = std::ranges::any_of(
        journal_.done, [&](const auto& frame) { return frame && frame->file == file; });
    if (!is_ours) {
      fs::remove(entry.path(), ignored);
    }
  }
}

Result<CaptureSummary> CaptureSession::Complete(CaptureCheck check) {
  Status status;
  if (!journal_.complete) {
    RemoveOtherFrames();
    status = writer_.Complete();
    journal_.complete = status.has_value();
  }
  CaptureSummary summary = Summarize(std::move(check));
  if (status) {
    summary.session = SessionOf(journal_);
    RecordShifts(summary.check, rig_, summary.session);
    status = WriteFileWhole(dir_ / kRecordFile, SessionToJson(summary.session));
  }
  if (!status) {
    return tl::unexpected(status.error());
  }
  std::error_code ignored;
  fs::remove_all(dir_ / kIncoming, ignored);
  return summary;
}

Result<CaptureSummary> CaptureSession::Finish() {
  Result<CaptureCheck> check = VerifyDone().and_then([&] { return CheckAll(); });
  if (!check) {
    return tl::unexpected(check.error());
  }
  if (!Exists(dir_ / kRecordFile)) {
    return Complete(*std::move(check));
  }
  return ReadSessionRecord(dir_).map([&](const Session& session) {
    CaptureSummary summary = Summarize(*std::move(check));
    summary.session = session;
    return summary;
  });
}

Status CaptureSession::TakeAll(Tools& tools) {
  for (int plans = 0; journal_.plan.empty() || asked_anew_ || !Open().empty();) {
    Status done;
    if (journal_.plan.empty() || asked_anew_ || brighter_) {
      if (plans++ == kMostPlans) {
        return Fail(ErrorCode::kBadData,
                    "light '{}' is too bright for every exposure that was found; do the lights "
                    "flicker? Or give --exposure",
                    rig_.lights[brighter_.value_or(0)].name);
      }
      done = MakePlan(tools);
    }
    done = done.and_then([&] { return TakeOpenFrames(tools); });
    if (!done) {
      return done;
    }
  }
  return {};
}

Result<CaptureSummary> CaptureSession::Run(LightBoard& board, TetheredCamera& camera,
                                           const Task& task, const CaptureObserver& observer) {
  Tools tools{board, camera, task, observer};
  Result<CaptureSummary> summary = TakeAndCheck(tools);
  if (!summary) {
    summary = tl::unexpected(WithNextStep(std::move(summary.error())));
  }
  return summary;
}

Result<CaptureSummary> CaptureSession::TakeAndCheck(Tools& tools) {
  if (const Status verified = VerifyDone(); !verified) {
    return tl::unexpected(verified.error());
  }
  for (int round = 1;; ++round) {
    if (const Status taken = TakeAll(tools); !taken) {
      return tl::unexpected(
          taken.error().code == ErrorCode::kCancelled
              ? Error{ErrorCode::kCancelled,
                      fmt::format("cancelled; the lights are off, and what was captured is kept: "
                                  "go on with sateen capture --resume {}",
                                  dir_.string())}
              : taken.error());
    }
    Tell(tools, "checking", "", 0.0);
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
    // A light that missed its cue may keep it the next time; nothing else mends itself.
    const bool may_mend = std::ranges::all_of(check->faults, [](const CaptureFault& fault) {
      return fault.kind == CaptureFaultKind::kDark || fault.kind == CaptureFaultKind::kLevel ||
             fault.kind == CaptureFaultKind::kShaded;
    });
    if (!may_mend || round == kRounds) {
      std::string text;
      for (const CaptureFault& fault : check->faults) {
        text += (text.empty() ? "" : "\n  ") + fault.text;
      }
      return Fail(ErrorCode::kBadData, "{}\nmend it, then go on: sateen capture --resume {}", text,
                  dir_.string());
    }
  }
}

}  // namespace sateen
