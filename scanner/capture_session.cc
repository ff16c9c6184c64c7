#include "scanner/capture_session.h"

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <thread>
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
using std::chrono::milliseconds;

constexpr const char* kRigFile = "rig.json";
constexpr const char* kRecordFile = "session.json";
constexpr const char* kFrames = "frames";
constexpr const char* kIncoming = "incoming";
constexpr int kRounds = 2;  // of taking again what the checks reject

// Turns everything off when it goes out of scope.
class LightsOff {
 public:
  explicit LightsOff(LightBoard& board) : board_(board) {}
  LightsOff(const LightsOff&) = delete;
  LightsOff& operator=(const LightsOff&) = delete;
  ~LightsOff() {
    if (board_.state() == LightBoard::State::kReady) {
      [[maybe_unused]] const Result<BoardState> ignored = board_.AllOff();
    }
  }

 private:
  LightBoard& board_;
};

// Speaks to the board while the camera exposes, so that it keeps the light on; turns the light off
// at once where the capture is cancelled. The board is its alone until Stop().
class KeepAlive {
 public:
  KeepAlive(LightBoard& board, milliseconds interval, const Task& task)
      : board_(board), interval_(interval), task_(task) {
    if (interval_ > milliseconds(0)) {
      thread_ = std::thread([this] { Run(); });
    }
  }
  KeepAlive(const KeepAlive&) = delete;
  KeepAlive& operator=(const KeepAlive&) = delete;
  ~KeepAlive() { Join(); }

  Status Stop() {
    Join();
    return status_;
  }

 private:
  static constexpr milliseconds kStep{50};  // how soon a cancellation is heard

  void Join() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
    }
    stop_.notify_all();
    if (thread_.joinable()) {
      thread_.join();
    }
  }

  void Run() {
    milliseconds silent{0};
    std::unique_lock lock(mutex_);
    while (!stop_.wait_for(lock, kStep, [&] { return stopped_; })) {
      silent += kStep;
      if (task_.Cancelled()) {
        [[maybe_unused]] const Result<BoardState> ignored = board_.AllOff();
        return;
      }
      if (silent >= interval_) {
        silent = milliseconds(0);
        if (const Result<BoardReport> report = board_.Report(); !report) {
          status_ = tl::unexpected(report.error());
          return;
        }
      }
    }
  }

  LightBoard& board_;
  milliseconds interval_;
  const Task& task_;
  std::mutex mutex_;  // for stopped_
  std::condition_variable stop_;
  bool stopped_ = false;
  Status status_;
  std::thread thread_;
};

std::string SafeName(std::string name) {
  for (char& c : name) {
    const bool is_safe = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                         (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
    c = is_safe ? c : '_';
  }
  return name;
}

std::string FileNameOf(std::size_t frame, const SessionFrame& planned, const fs::path& delivered) {
  const std::string name = planned.role == FrameRole::kDark ? "dark" : SafeName(planned.light);
  return fmt::format("{}/{:02}-{}{}{}", kFrames, frame, name,
                     planned.role == FrameRole::kRepeat ? "-again" : "",
                     LowerCase(delivered.extension().string()));
}

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

bool MayBeTriedAgain(ErrorCode code) {
  return code == ErrorCode::kBadData || code == ErrorCode::kDevice || code == ErrorCode::kTimeout;
}

tl::unexpected<Error> Cancelled() {
  return Fail(ErrorCode::kCancelled,
              "cancelled; the lights are off, and what was captured is kept: go on with --resume");
}

// The board's word that this light alone is on, or none.
Status ConfirmLit(const Light* light, const BoardState& state, const char* when) {
  const unsigned wanted = light == nullptr ? 0U : 1U << static_cast<unsigned>(light->channel);
  if (state.lit == wanted) {
    return {};
  }
  const std::string what =
      light == nullptr ? "no light" : fmt::format("light '{}' alone", light->name);
  return Fail(
      ErrorCode::kDevice, "{} should be on {}, but the board says that channels {:#06x} are{}",
      what, when, state.lit,
      state.fault != 0 ? fmt::format(" (fault {}: {})", state.fault, FaultText(state.fault))
      : light != nullptr && state.lit == 0 ? "; did the camera take longer than --margin allows?"
                                           : "");
}

}  // namespace

FramePlan PlanOf(const Rig& rig) {
  FramePlan plan = {{.role = FrameRole::kDark}};
  for (const Light& light : rig.lights) {
    plan.push_back({.role = FrameRole::kLit, .light = light.name});
  }
  plan.push_back({.role = FrameRole::kRepeat, .light = rig.lights.front().name});
  plan.push_back({.role = FrameRole::kDark});
  return plan;
}

Session SessionOf(const Journal& journal) {
  Session session{
      .kind = journal.begun.kind, .rig = journal.begun.rig, .rig_sha256 = journal.begun.rig_sha256};
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
      settings_(journal_.begun.settings),
      looks_(journal_.done.size()) {}

Result<CaptureSession> CaptureSession::Begin(const fs::path& dir, const fs::path& rig_file,
                                             const CaptureOptions& options) {
  const Result<std::string> rig_text =
      options.Validate().and_then([&] { return ReadFileBytes(rig_file); });
  if (!rig_text) {
    return tl::unexpected(rig_text.error());
  }
  Result<Rig> rig = ReadRig(rig_file);
  Status status = rig ? CheckLights(*rig, rig_file) : tl::unexpected(rig.error());
  // A journal without a whole record: killed before anything was captured.
  const bool has_journal = Exists(dir / kJournalFile) && ReadJournal(dir).value_or(Journal());
  if (status && (Exists(dir / kRecordFile) || has_journal)) {
    status =
        Fail(ErrorCode::kInvalidArgument,
             "{}: holds a session already; choose another folder, or go on with it: --resume {}",
             dir.string(), dir.string());
  }
  status = status.and_then([&] { return MakeFolder(dir / kFrames); }).and_then([&] {
    return WriteFileWhole(dir / kRigFile, *rig_text);
  });
  if (!status) {
    return tl::unexpected(status.error());
  }
  Result<JournalWriter> writer = JournalWriter::Open(dir, 0);
  if (!writer) {
    return tl::unexpected(writer.error());
  }
  Journal journal{.begun = {.kind = options.kind,
                            .rig = kRigFile,
                            .rig_sha256 = Sha256(*rig_text),
                            .settings = options.settings,
                            .level = options.level,
                            .plan = PlanOf(*rig)}};
  journal.done.resize(journal.begun.plan.size());
  if (const Status begun = writer->Begin(journal.begun); !begun) {
    return tl::unexpected(begun.error());
  }
  return CaptureSession(dir, *std::move(rig), std::move(journal), *std::move(writer), options);
}

Result<CaptureSession> CaptureSession::Resume(const fs::path& dir, const CaptureOptions& options) {
  if (const Status valid = options.Validate(); !valid) {
    return tl::unexpected(valid.error());
  }
  Result<std::optional<Journal>> read = ReadJournal(dir);
  if (!read) {
    return tl::unexpected(read.error());
  }
  if (!*read) {
    return Fail(ErrorCode::kBadData, "{}: nothing was captured yet; begin anew, with --rig and -o",
                dir.string());
  }
  Journal journal = **std::move(read);
  const fs::path rig_file = dir / journal.begun.rig;
  const Result<std::string> hash = Sha256OfFile(rig_file);
  Result<Rig> rig = hash ? ReadRig(rig_file) : tl::unexpected(hash.error());
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  if (*hash != journal.begun.rig_sha256) {
    return Fail(ErrorCode::kBadData,
                "{}: is not the rig that this capture began with; restore it, or capture anew",
                rig_file.string());
  }
  const FramePlan plan = PlanOf(*rig);
  const bool same_plan = std::ranges::equal(
      plan, journal.begun.plan,
      [](const auto& a, const auto& b) { return a.role == b.role && a.light == b.light; });
  if (!same_plan) {
    return Fail(ErrorCode::kBadData, "{}: plans other frames than this program takes; capture anew",
                (dir / kJournalFile).string());
  }
  Result<JournalWriter> writer = JournalWriter::Open(dir, journal.whole_bytes);
  if (!writer) {
    return tl::unexpected(writer.error());
  }
  return CaptureSession(dir, *std::move(rig), std::move(journal), *std::move(writer), options);
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
  const auto light = std::ranges::find(rig_.lights, journal_.begun.plan[frame].light, &Light::name);
  return light == rig_.lights.end() ? nullptr : &*light;
}

std::string CaptureSession::NameOf(std::size_t frame) const {
  const SessionFrame& planned = journal_.begun.plan[frame];
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

Result<SessionFrame> CaptureSession::Accept(std::size_t frame, const CapturedFile& file) {
  SessionFrame done = journal_.begun.plan[frame];
  done.exposure_s = settings_.exposure_s;
  done.f_number = settings_.f_number;
  done.iso = settings_.iso;
  Result<FrameLook> look = CheckFrame({file.path, done.Exposure(), std::nullopt, rig_.response},
                                      rig_, settings_, done.role, options_.checks);
  if (!look) {
    return tl::unexpected(look.error());
  }
  done.sha256 = look->means.sha256;
  done.file = FileNameOf(frame, done, file.path);
  const fs::path place = dir_ / done.file;
  Status placed = FlushToDisk(file.path, place).and_then([&]() -> Status {
    std::error_code error;
    fs::rename(file.path, place, error);
    if (error) {
      return Fail(ErrorCode::kIo, "{}: cannot put in place: {}", place.string(), error.message());
    }
    return FlushToDisk(place.parent_path(), place.parent_path());
  });
  if (!placed) {
    return tl::unexpected(placed.error());
  }
  looks_[frame] = *std::move(look);
  return done;
}

Result<SessionFrame> CaptureSession::TryFrame(std::size_t frame, LightBoard& board,
                                              TetheredCamera& camera, const Task& task) {
  std::error_code ignored;  // what is left there is only in the way
  fs::remove_all(dir_ / kIncoming, ignored);
  Status ready = MakeFolder(dir_ / kIncoming);
  if (ready && board.state() != LightBoard::State::kReady) {
    ready = board.Connect();
  }
  if (!ready) {
    return tl::unexpected(ready.error());
  }
  const LightsOff off(board);
  const Light* light = LightOf(frame);
  const milliseconds exposure(static_cast<int>(std::ceil(1000.0 * settings_.exposure_s)));
  Result<BoardState> state;
  if (light == nullptr) {
    state = board.AllOff();
  } else {
    const auto channel = static_cast<std::size_t>(light->channel);
    milliseconds on_time = options_.settle + exposure + options_.margin;
    if (channel < board.Info().lights.size()) {
      on_time = std::min(on_time, board.Info().lights[channel].max_on);
    }
    state = board.SetLight(light->channel, journal_.begun.level, on_time);
  }
  Status lit =
      state ? ConfirmLit(light, *state, "before the exposure") : tl::unexpected(state.error());
  if (!lit) {
    return tl::unexpected(lit.error());
  }
  board.Wait(options_.settle);
  KeepAlive keep_alive(board, options_.keep_alive, task);
  const Result<CapturedFile> file = camera.Capture(dir_ / kIncoming, exposure + options_.deadline);
  const Status kept = keep_alive.Stop();
  if (task.Cancelled()) {
    return Cancelled();
  }
  if (!file) {
    return tl::unexpected(file.error());
  }
  const Result<BoardReport> report = kept ? board.Report() : tl::unexpected(kept.error());
  lit = report ? ConfirmLit(light, report->state, "until the camera had delivered")
               : tl::unexpected(report.error());
  if (!lit) {
    return tl::unexpected(lit.error());
  }
  const Result<BoardState> dark = board.AllOff();
  lit = dark ? ConfirmLit(nullptr, *dark, "after the exposure") : tl::unexpected(dark.error());
  if (!lit) {
    return tl::unexpected(lit.error());
  }
  return Accept(frame, *file);
}

Status CaptureSession::TakeFrame(std::size_t frame, LightBoard& board, TetheredCamera& camera,
                                 const Task& task) {
  for (int attempt = 1;; ++attempt) {
    if (task.Cancelled()) {
      return Cancelled();
    }
    if (Status begun = writer_.FrameBegun(frame); !begun) {
      return begun;
    }
    const Result<SessionFrame> taken = TryFrame(frame, board, camera, task);
    if (taken) {
      ++taken_;
      return writer_.FrameDone(frame, *taken).map([&] { journal_.done[frame] = *taken; });
    }
    Error error = taken.error();
    if (!MayBeTriedAgain(error.code)) {
      return tl::unexpected(error);
    }
    if (Status rejected = Reject(frame, error.message); !rejected) {
      return rejected;
    }
    error.message =
        fmt::format("frame {} of {} ({}): {}{}", frame + 1, journal_.done.size(), NameOf(frame),
                    error.message, attempt > 1 ? fmt::format("; tried {} times", attempt) : "");
    if (attempt == options_.tries) {
      return tl::unexpected(error);
    }
    if (error.code == ErrorCode::kDevice || error.code == ErrorCode::kTimeout) {
      const Status again = camera.Open()
                               .and_then([&](const CameraInfo&) {
                                 return camera.Configure(journal_.begun.settings);
                               })
                               .map([&](const ExposureSettings& set) { settings_ = set; });
      if (!again) {
        return Fail(again.error().code, "{}; and then: {}", error.message, again.error().message);
      }
    }
  }
}

Status CaptureSession::TakeOpenFrames(LightBoard& board, TetheredCamera& camera, const Task& task) {
  const std::vector<std::size_t> open = Open();
  const auto begin = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < open.size(); ++i) {
    std::string left;
    if (i > 0) {
      const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
      left = fmt::format(", {:.0f} s left", std::ceil(spent.count() / static_cast<double>(i) *
                                                      static_cast<double>(open.size() - i)));
    }
    task.BeginStage(NameOf(open[i]) + left, static_cast<int>(journal_.done.size()));
    task.Advance(static_cast<int>(journal_.done.size() - open.size() + i));
    if (Status taken = TakeFrame(open[i], board, camera, task); !taken) {
      return taken;
    }
  }
  return {};
}

Result<CaptureCheck> CaptureSession::CheckAll(const Task& task) {
  CaptureLooks looks;
  task.BeginStage("checking", static_cast<int>(looks_.size()));
  for (std::size_t frame = 0; frame < looks_.size(); ++frame) {
    const SessionFrame& done = *journal_.done[frame];
    if (!looks_[frame]) {  // of an earlier run
      Result<FrameLook> look = CheckFrame(FileOf(done), rig_, {.exposure_s = *done.exposure_s},
                                          done.role, options_.checks);
      if (!look) {
        return tl::unexpected(look.error());
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
    task.Advance();
  }
  return CheckCapture(rig_, looks, options_.checks);
}

Status CaptureSession::RejectFaults(const CaptureCheck& check) {
  for (const CaptureFault& fault : check.faults) {
    for (std::size_t frame = 0; frame < journal_.done.size(); ++frame) {
      const bool is_lit = journal_.begun.plan[frame].role == FrameRole::kLit;
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

Result<CaptureSummary> CaptureSession::Complete(CaptureCheck check) {
  Status status;
  if (!journal_.complete) {
    status = writer_.Complete();
    journal_.complete = status.has_value();
  }
  CaptureSummary summary{.check = std::move(check), .taken = taken_, .rejected = rejected_};
  summary.kept = static_cast<int>(journal_.done.size()) - taken_;
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

Result<CaptureSummary> CaptureSession::Run(LightBoard& board, TetheredCamera& camera,
                                           const Task& task) {
  if (const Status verified = VerifyDone(); !verified) {
    return tl::unexpected(verified.error());
  }
  for (int round = 1;; ++round) {
    if (!Open().empty()) {
      const Result<ExposureSettings> set = camera.Configure(journal_.begun.settings);
      if (!set) {
        return tl::unexpected(set.error());
      }
      settings_ = *set;
      if (const Status taken = TakeOpenFrames(board, camera, task); !taken) {
        return tl::unexpected(taken.error());
      }
    }
    Result<CaptureCheck> check = CheckAll(task);
    if (!check) {
      return tl::unexpected(check.error());
    }
    if (check->faults.empty() || journal_.complete) {
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
