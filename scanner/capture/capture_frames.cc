// The frames of a CaptureSession, one by one.
#include <algorithm>
#include <deque>
#include <utility>

#include "core/file_io.h"
#include "core/output_folder.h"
#include "scanner/capture/capture_session.h"
#include "scanner/capture/exposure_search.h"
#include "scanner/capture/lit_exposure.h"
#include "scanner/sessions/files/folder_listing.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr double kFabricPeak = 0.8;  // of what saturates
constexpr double kSheetPeak = 0.6;   // its readings must be proportional to 0.2 %
constexpr int kMostTests = 8;        // frames to find an exposure by

std::string SafeName(std::string name) {
  for (char& c : name) {
    const bool is_safe = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                         (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
    c = is_safe ? c : '_';
  }
  return name;
}

// "frames/03-led-2.dng"; "frames/04-led-2.dng" is the same light's next exposure.
std::string FileNameOf(std::size_t frame, const SessionFrame& planned, const fs::path& delivered) {
  const std::string name = planned.role == FrameRole::kDark ? "dark" : SafeName(planned.light);
  return fmt::format("frames/{:02}-{}{}{}", frame, name,
                     planned.role == FrameRole::kRepeat ? "-again" : "",
                     LowerCase(delivered.extension().string()));
}

Status MakeEmptyFolder(const fs::path& path) {
  std::error_code error;  // what cannot be removed is in nobody's way
  fs::remove_all(path, error);
  fs::create_directories(path, error);
  if (error) {
    return Fail(ErrorCode::kIo, "{}: cannot create this folder: {}", path.string(),
                error.message());
  }
  return {};
}

bool MayBeTriedAgain(ErrorCode code) {
  return code == ErrorCode::kBadData || code == ErrorCode::kDevice || code == ErrorCode::kTimeout;
}

// The light that gives the table most, by the rig.
std::size_t BrightestLight(const Rig& rig) {
  std::size_t brightest = 0;
  double most = 0.0;
  for (std::size_t k = 0; k < rig.lights.size(); ++k) {
    const Incident incident = IncidentAt(rig.lights[k], Eigen::Vector3d::Zero());
    const double given = incident.e_rgb.maxCoeff() * std::max(0.0, incident.l.z());
    if (given > most) {
      most = given;
      brightest = k;
    }
  }
  return brightest;
}

}  // namespace

Result<ExposureSettings> CaptureSession::Configure(double exposure_s, TetheredCamera& camera) {
  if (configured_ && configured_->asked_s == exposure_s) {
    return configured_->settings;
  }
  configured_.reset();
  Result<ExposureSettings> set = camera.Configure(
      {.exposure_s = exposure_s, .f_number = journal_.begun.f_number, .iso = journal_.begun.iso});
  if (set) {
    configured_ = Configured{exposure_s, *set};
  }
  return set;
}

Status CaptureSession::MakePlan(Tools& tools) {
  FramePlan plan;
  std::string reason;
  if (const std::optional<double> exposure_s = AskedExposure()) {
    plan = PlanOf(rig_, {*exposure_s});
    reason = "exposure as asked";
  } else {
    const std::size_t light = brighter_.value_or(BrightestLight(rig_));
    const Result<std::vector<double>> exposures_s = Meter(light, tools);
    if (!exposures_s) {
      return tl::unexpected(exposures_s.error());
    }
    plan = PlanOf(rig_, *exposures_s);
    reason = fmt::format("exposure found with light '{}'", rig_.lights[light].name);
  }
  brighter_.reset();
  PlannedExposure asked;
  if (asked_anew_) {
    asked = {.is_new = true, .exposure_s = asked_anew_->exposure_s};
  }
  return writer_.Planned(plan, reason, asked).map([&] {
    journal_.begun.exposure_s = AskedExposure();
    asked_anew_.reset();
    journal_.plan = std::move(plan);
    journal_.done.assign(journal_.plan.size(), std::nullopt);
    looks_.assign(journal_.plan.size(), std::nullopt);
    is_new_.assign(journal_.plan.size(), false);
  });
}

// How bright the light's frame is at this exposure. Board and camera are given as many tries as for a
// frame that counts.
Result<SignalLevels> CaptureSession::TakeTestFrame(const Light& light, double exposure_s,
                                                   Tools& tools) {
  for (int attempt = 1;; ++attempt) {
    const Result<ExposureSettings> set = MakeEmptyFolder(dir_ / kIncoming).and_then([&] {
      return Configure(exposure_s, tools.camera);
    });
    const Result<LitFrame> shot =
        set ? ExposeLit(tools.board, tools.camera, {&light, journal_.begun.level, set->exposure_s},
                        options_, dir_ / kIncoming, tools.task)
            : tl::unexpected(set.error());
    Result<SignalLevels> levels =
        shot ? ReadSignalLevels({.path = shot->file.path, .response = rig_.response})
             : tl::unexpected(shot.error());
    if (levels || attempt == options_.tries || !MayBeTriedAgain(levels.error().code) ||
        tools.camera.NeedsAPerson()) {
      return levels;
    }
    if (const Status again = Reopen(levels.error(), tools.camera); !again) {
      return tl::unexpected(again.error());
    }
  }
}

Result<std::vector<double>> CaptureSession::Meter(std::size_t light, Tools& tools) {
  const Light& lit = rig_.lights[light];
  if (tools.board.state() != LightBoard::State::kReady) {
    if (const Status connected = tools.board.Connect(); !connected) {
      return tl::unexpected(connected.error());
    }
  }
  double longest_s = LongestExposure(tools.board.Info(), lit, options_);
  for (const Light& other : rig_.lights) {
    longest_s = std::min(longest_s, LongestExposure(tools.board.Info(), other, options_));
  }
  const bool is_sheet = journal_.begun.kind == SessionKind::kSheet;
  Result<ExposureSearch> search = ExposureSearch::Begin(
      tools.camera.ExposureTimes(), {.peak = is_sheet ? kSheetPeak : kFabricPeak,
                                     .low = DarkestUseful(rig_.response),
                                     .most = is_sheet ? 1 : journal_.begun.brackets,
                                     .longest_s = longest_s});
  for (int test = 1; search && !search->Found(); ++test) {
    Tell(tools, "metering", lit.name, search->TestTime());
    const Result<SignalLevels> levels = TakeTestFrame(lit, search->TestTime(), tools);
    Status taken = levels ? search->Take(*levels) : tl::unexpected(levels.error());
    if (taken && !search->Found() && test == kMostTests) {
      taken = Fail(ErrorCode::kDevice, "no exposure found in {} of them; give --exposure", test);
    }
    if (!taken) {
      return Fail(taken.error().code, "test frame of light '{}': {}", lit.name,
                  taken.error().message);
    }
    peak_ = levels->peak;
  }
  return search.map([](const ExposureSearch& found) { return found.Exposures(); });
}

Result<CaptureSession::Arrived> CaptureSession::Shoot(std::size_t frame, int attempt,
                                                      Tools& tools) {
  const SessionFrame& planned = journal_.plan[frame];
  // A folder of its own, since the frame before may still lie in its own.
  const fs::path folder = dir_ / kIncoming / fmt::format("{:02}-{}", frame, attempt);
  if (const Status made = MakeEmptyFolder(folder); !made) {
    return tl::unexpected(made.error());
  }
  const Result<ExposureSettings> set = Configure(*planned.exposure_s, tools.camera);
  if (!set) {
    return tl::unexpected(set.error());
  }
  const Result<LitFrame> shot =
      ExposeLit(tools.board, tools.camera, {LightOf(frame), journal_.begun.level, set->exposure_s},
                options_, folder, tools.task);
  if (!shot) {
    return tl::unexpected(shot.error());
  }
  camera_time_ += shot->camera_time;
  const fs::path path = shot->file.path;
  Arrived arrived{.frame = frame, .record = planned, .path = path};
  arrived.record.exposure_s = set->exposure_s;
  arrived.record.f_number = set->f_number;
  arrived.record.iso = set->iso;
  arrived.record.file = FileNameOf(frame, planned, path);
  FrameCheckOptions checks = options_.checks;
  if (planned.role != FrameRole::kDark || journal_.begun.exposure_s) {
    checks.max_saturated = 1.0;  // Settle() looks: the shorter exposure has it, or another is found
  }
  arrived.look = std::async(
      std::launch::async,
      [this, checks, settings = *set, role = planned.role, place = dir_ / arrived.record.file,
       of = FrameFile{path, arrived.record.Exposure(), std::nullopt, rig_.response}] {
        Result<FrameLook> look = CheckFrame(of, rig_, settings, role, checks);
        const Status flushed = look ? FlushToDisk(of.path, place) : Status{};
        return flushed ? std::move(look) : Result<FrameLook>(tl::unexpected(flushed.error()));
      });
  return arrived;
}

// From incoming/ to where the record says.
Status CaptureSession::Place(const Arrived& arrived, SessionFrame& record) {
  const fs::path place = dir_ / record.file;
  std::error_code error;
  fs::rename(arrived.path, place, error);
  if (error) {
    return Fail(ErrorCode::kIo, "{}: cannot put in place: {}", place.string(), error.message());
  }
  fs::remove_all(arrived.path.parent_path(), error);
  return FlushToDisk(place.parent_path(), place.parent_path());
}

// At an exposure given by hand nothing would change between tries.
Status CaptureSession::CheckClipped(std::size_t frame, const SignalLevels& levels) {
  is_clipped_ = journal_.begun.exposure_s && levels.saturated > options_.checks.max_saturated;
  if (!is_clipped_) {
    return {};
  }
  return Fail(ErrorCode::kBadData,
              "{:.2g} % of its sites are saturated at {:.4g} s; at most {:.2g} % may be: {}go on "
              "with a shorter exposure, or with one that is found: sateen capture --resume {} "
              "--exposure auto",
              100.0 * levels.saturated, *journal_.begun.exposure_s,
              100.0 * options_.checks.max_saturated,
              LightOf(frame) == nullptr ? "darken the room, or " : "", dir_.string());
}

Status CaptureSession::Settle(Arrived arrived, Tools& tools) {
  Result<FrameLook> look = arrived.look.get();
  is_clipped_ = false;
  if (!look) {
    return tl::unexpected(look.error());
  }
  const std::size_t frame = arrived.frame;
  peak_ = look->levels.peak;
  if (Status clipped = CheckClipped(frame, look->levels); !clipped) {
    return clipped;
  }
  if (!journal_.begun.exposure_s && IsBase(frame) && LightOf(frame) != nullptr &&
      look->levels.saturated > options_.checks.max_saturated) {
    brighter_ = static_cast<std::size_t>(LightOf(frame) - rig_.lights.data());
    return Reject(frame,
                  fmt::format("light '{}' is brighter than the exposure allows", NameOf(frame)));
  }
  arrived.record.sha256 = look->means.sha256;
  Status placed = Place(arrived, arrived.record).and_then([&] {
    return writer_.FrameDone(frame, arrived.record);
  });
  if (placed) {
    looks_[frame] = *std::move(look);
    journal_.done[frame] = std::move(arrived.record);
    is_new_[frame] = true;
    ++settled_;
    Tell(tools, "capturing", "", 0.0);
  }
  return placed;
}

Status CaptureSession::TakeAgain(Error error, std::size_t frame, int attempt, Tools& tools) {
  if (!MayBeTriedAgain(error.code)) {
    return tl::unexpected(std::move(error));
  }
  if (Status rejected = Reject(frame, error.message); !rejected) {
    return rejected;
  }
  error.message =
      fmt::format("frame {} of {} ({}): {}{}", frame + 1, journal_.plan.size(), NameOf(frame),
                  error.message, attempt > 1 ? fmt::format("; tried {} times", attempt) : "");
  if (attempt == options_.tries || is_clipped_ || tools.camera.NeedsAPerson()) {
    return tl::unexpected(std::move(error));
  }
  return Reopen(error, tools.camera);
}

// After what may have been the camera's fault.
Status CaptureSession::Reopen(const Error& error, TetheredCamera& camera) {
  if (error.code != ErrorCode::kDevice && error.code != ErrorCode::kTimeout) {
    return {};
  }
  configured_.reset();
  const Result<CameraInfo> again = camera.Open();
  return again ? Status()
               : Fail(again.error().code, "{}; and then: {}", error.message, again.error().message);
}

Status CaptureSession::TakeOpenFrames(Tools& tools) {
  const std::vector<std::size_t> in_order = Open();
  std::deque<std::size_t> open(in_order.begin(), in_order.end());
  std::vector<int> attempts(journal_.plan.size());
  std::optional<Arrived> arrived;  // looked at while the next frame is being taken
  Status status;
  const auto again = [&](const Error& error, std::size_t frame) {
    open.push_front(frame);
    return TakeAgain(error, frame, attempts[frame], tools);
  };
  while (status && !brighter_ && (!open.empty() || arrived)) {
    std::optional<Arrived> next;
    if (!open.empty()) {
      const std::size_t frame = open.front();
      open.pop_front();
      Tell(tools, "capturing", NameOf(frame), *journal_.plan[frame].exposure_s);
      status = writer_.FrameBegun(frame);
      Result<Arrived> shot =
          status ? Shoot(frame, ++attempts[frame], tools) : tl::unexpected(status.error());
      if (shot) {
        next = *std::move(shot);
      } else if (status) {
        status = again(shot.error(), frame);
      }
    }
    if (arrived) {
      const std::size_t frame = arrived->frame;
      const Status settled = Settle(*std::exchange(arrived, std::nullopt), tools);
      if (!settled) {
        const Status taken_again = again(settled.error(), frame);
        status = status ? taken_again : status;
      }
    }
    arrived = std::move(next);
  }
  if (arrived) {  // what arrived before it went wrong is not lost
    const Status settled = Settle(*std::move(arrived), tools);
    status = status && !settled && !brighter_ ? settled : status;
  }
  return status;
}

}  // namespace sateen
