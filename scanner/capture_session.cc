#include "scanner/capture_session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/check.h"
#include "core/file_io.h"
#include "core/output_folder.h"
#include "core/sha256.h"
#include "scanner/folder_listing.h"
#include "scanner/frame_loader.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRigFile = "rig.json";
constexpr const char* kRecordFile = "session.json";
constexpr int kRounds = 2;     // of taking again what the checks reject
constexpr int kMostPlans = 3;  // because a light was brighter than the exposures found

Status MakeFolder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) {
    return Fail(ErrorCode::kIo, "{}: cannot create this folder: {}", path.string(),
                error.message());
  }
  return {};
}

// Each light has a channel of its own, or two frames would be of one light.
Status CheckLights(const Rig& rig, const fs::path& file) {
  const Lights& lights = rig.lights;
  if (lights.empty()) {
    return Fail(ErrorCode::kBadData, "{}: has no lights; give it their names and channels",
                file.string());
  }
  for (size_t k = 0; k < lights.size(); ++k) {
    for (size_t j = 0; j < k; ++j) {
      if (lights[j].channel == lights[k].channel) {
        return Fail(ErrorCode::kBadData,
                    "{}: lights '{}' and '{}' both have channel {}; need one each", file.string(),
                    lights[j].name, lights[k].name, lights[k].channel);
      }
    }
  }
  return {};
}

// A journal without a frame that is done has nothing to lose: killed before, or without a camera.
bool HasFrames(const fs::path& dir) {
  if (!Exists(dir / kJournalFile)) {
    return false;
  }
  const Result<std::optional<Journal>> journal = ReadJournal(dir);
  return !journal || (*journal && std::ranges::any_of((*journal)->done, [](const auto& frame) {
    return frame.has_value();
  }));
}

bool IsPlanOf(const Rig& rig, const FramePlan& plan) {
  std::vector<double> exposures_s;
  for (const SessionFrame& frame : plan) {
    if (frame.role == FrameRole::kLit && !rig.lights.empty() &&
        frame.light == rig.lights.front().name) {
      exposures_s.push_back(*frame.exposure_s);
    }
  }
  return !exposures_s.empty() &&
         std::ranges::equal(plan, PlanOf(rig, exposures_s), [](const auto& a, const auto& b) {
           return a.role == b.role && a.light == b.light && a.exposure_s == b.exposure_s;
         });
}

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

Result<Rig> CaptureSession::CheckBegin(const fs::path& dir, const fs::path& rig_file,
                                       const CaptureOptions& options) {
  Result<Rig> rig = options.Validate().and_then([&] { return ReadRig(rig_file); });
  Status status = rig ? CheckLights(*rig, rig_file) : tl::unexpected(rig.error());
  if (status && (Exists(dir / kRecordFile) || HasFrames(dir))) {
    status =
        Fail(ErrorCode::kInvalidArgument,
             "{}: holds a session already; choose another folder, or go on with it: sateen capture "
             "--resume {}",
             dir.string(), dir.string());
  }
  return status ? std::move(rig) : tl::unexpected(status.error());
}

Result<CaptureSession> CaptureSession::Begin(const fs::path& dir, const fs::path& rig_file,
                                             const CaptureOptions& options) {
  Result<Rig> rig = CheckBegin(dir, rig_file, options);
  const Result<std::string> rig_text = rig ? ReadFileBytes(rig_file) : tl::unexpected(rig.error());
  const Status made = rig_text ? MakeFolder(dir / "frames") : tl::unexpected(rig_text.error());
  if (!made) {
    return tl::unexpected(made.error());
  }
  const fs::path parent = fs::absolute(dir).lexically_normal().parent_path();
  Result<JournalWriter> writer =
      FlushToDisk(parent, parent).and_then([&] { return JournalWriter::Open(dir); });
  if (!writer) {
    return tl::unexpected(writer.error());
  }
  // Again, now that no other program can begin here; then what was there goes.
  const Status ready = CheckBegin(dir, rig_file, options)
                           .and_then([&](const Rig&) { return writer->Keep(0); })
                           .and_then([&] { return WriteFileWhole(dir / kRigFile, *rig_text); });
  if (!ready) {
    return tl::unexpected(ready.error());
  }
  const Journal journal{.begun = {.kind = options.kind,
                                  .rig = kRigFile,
                                  .rig_sha256 = Sha256(*rig_text),
                                  .exposure_s = options.exposure_s,
                                  .f_number = options.f_number,
                                  .iso = options.iso,
                                  .level = options.level,
                                  .brackets = options.brackets}};
  if (const Status begun = writer->Begin(journal.begun); !begun) {
    return tl::unexpected(begun.error());
  }
  return CaptureSession(dir, *std::move(rig), journal, *std::move(writer), options);
}

Result<Journal> CaptureSession::CheckResume(const fs::path& dir) {
  if (!Exists(dir / kJournalFile)) {
    return Fail(ErrorCode::kIo, "{}: is not there; nothing was captured",
                (dir / kJournalFile).string());
  }
  Result<std::optional<Journal>> read = ReadJournal(dir);
  if (!read) {
    return tl::unexpected(read.error());
  }
  if (!*read) {
    return Fail(ErrorCode::kBadData, "{}: nothing was captured yet; begin anew, with --rig and -o",
                dir.string());
  }
  const Journal& journal = **read;
  const fs::path rig_file = dir / journal.begun.rig;
  const Result<std::string> hash = Sha256OfFile(rig_file);
  const Result<Rig> rig = hash ? ReadRig(rig_file) : tl::unexpected(hash.error());
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  if (*hash != journal.begun.rig_sha256) {
    return Fail(ErrorCode::kBadData,
                "{}: is not the rig that this capture began with; restore it, or capture anew",
                rig_file.string());
  }
  if (!journal.plan.empty() && !IsPlanOf(*rig, journal.plan)) {
    return Fail(ErrorCode::kBadData, "{}: plans other frames than this program takes; capture anew",
                (dir / kJournalFile).string());
  }
  return **std::move(read);
}

Result<CaptureSession> CaptureSession::Resume(const fs::path& dir, const CaptureOptions& options) {
  Status ready = options.Validate().and_then([&] { return CheckResume(dir).map([](Journal) {}); });
  Result<JournalWriter> writer = ready ? JournalWriter::Open(dir) : tl::unexpected(ready.error());
  // Again, now that no other program can go on here.
  Result<Journal> journal = writer ? CheckResume(dir) : tl::unexpected(writer.error());
  Result<Rig> rig = journal ? ReadRig(dir / journal->begun.rig) : tl::unexpected(journal.error());
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  if (const Status kept = writer->Keep(journal->whole_bytes); !kept) {
    return tl::unexpected(kept.error());
  }
  return CaptureSession(dir, *std::move(rig), *std::move(journal), *std::move(writer), options);
}

Status CaptureSession::CompleteSession(const fs::path& dir) {
  return Fail(ErrorCode::kInvalidArgument,
              "{}: is a complete session, whose exposure cannot change; capture anew, into another "
              "folder",
              dir.string());
}

Status CaptureSession::ChangeExposure(std::optional<double> exposure_s) {
  if (journal_.complete) {
    return CompleteSession(dir_);
  }
  asked_anew_ = AskedAnew{exposure_s};
  return {};
}

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
        return tl::unexpected(hash.error());
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
    const FrameLook* look = &*looks_[frame];
    if (done.role == FrameRole::kLit) {
      looks.lit.push_back(look);
    } else if (done.role == FrameRole::kRepeat) {
      looks.repeat = look;
    } else {
      (looks.dark_first == nullptr ? looks.dark_first : looks.dark_last) = look;
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
