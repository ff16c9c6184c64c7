#include "scanner/capture/plan_taker.h"

#include <deque>
#include <utility>

namespace sateen {

namespace fs = std::filesystem;

PlanTaker::PlanTaker(SessionStore& store, FrameLooks& looks, const CaptureOptions& options,
                     FrameTaker& taker, CaptureProgress& progress)
    : store_(store), looks_(looks), options_(options), taker_(taker), progress_(progress) {}

std::optional<std::size_t> PlanTaker::LightOfFrame(std::size_t frame) const {
  return LightOf(store_.GetRig(), Planned(frame));
}

Status PlanTaker::Reject(std::size_t frame, const std::string& reason) {
  looks_[frame].reset();
  return store_.RejectFrame(frame, reason);
}

Result<ArrivedFrame> PlanTaker::Take(std::size_t frame, int attempt) {
  const SessionFrame& planned = Planned(frame);
  const Rig& rig = store_.GetRig();
  const std::optional<std::size_t> light = LightOfFrame(frame);
  // A folder of its own, since the frame before may still lie in its own.
  const fs::path folder = store_.Incoming() / fmt::format("{:02}-{}", frame, attempt);
  const Result<TakenFrame> taken = taker_.Take(
      light ? std::optional(rig.lights[*light]) : std::nullopt, *planned.exposure_s, folder);
  if (!taken) {
    return tl::unexpected(taken.error());
  }
  progress_.AddCameraTime(taken->camera_s);
  SessionFrame record = planned;
  record.exposure_s = taken->settings.exposure_s;
  record.f_number = taken->settings.f_number;
  record.iso = taken->settings.iso;
  record.file = FileNameOf(frame, planned, taken->path);
  FrameCheckOptions checks = options_.checks;
  if (planned.role != FrameRole::kDark || store_.Record().begun.exposure_s) {
    checks.max_saturated = 1.0;  // left to Settle(): a shorter exposure has it, or another is found
  }
  return ArrivedFrame(frame, std::move(record), taken->path, store_.Folder(), rig, checks);
}

// At an exposure given by hand nothing would change between tries.
Status PlanTaker::CheckClipped(std::size_t frame, const SignalLevels& levels) {
  const std::optional<double> exposure_s = store_.Record().begun.exposure_s;
  is_clipped_ = exposure_s && levels.saturated > options_.checks.max_saturated;
  if (!is_clipped_) {
    return {};
  }
  return Fail(ErrorCode::kBadData,
              "{:.2g} % of its pixels are saturated at {:.4g} s, more than {:.2g} %; {}continue "
              "with a shorter exposure, or with one that is found: sateen capture --resume {} "
              "--exposure auto",
              100.0 * levels.saturated, *exposure_s, 100.0 * options_.checks.max_saturated,
              LightOfFrame(frame) ? "" : "darken the room, or ", store_.Folder().string());
}

Status PlanTaker::Settle(ArrivedFrame arrived) {
  Result<FrameLook> look = arrived.TakeLook();
  is_clipped_ = false;
  if (!look) {
    return tl::unexpected(look.error());
  }
  const std::size_t frame = arrived.Frame();
  progress_.SetPeak(look->levels.peak);
  if (Status clipped = CheckClipped(frame, look->levels); !clipped) {
    return clipped;
  }
  if (!store_.Record().begun.exposure_s && IsFirstExposure(store_.Record().plan, frame) &&
      LightOfFrame(frame) && look->levels.saturated > options_.checks.max_saturated) {
    brighter_ = LightOfFrame(frame);
    return Reject(frame, fmt::format("light '{}' is brighter than the exposure allows",
                                     NameOf(Planned(frame))));
  }
  SessionFrame record = arrived.Record();
  record.sha256 = look->means.sha256;
  return store_.KeepFrame(frame, std::move(record), arrived.Path()).map([&] {
    looks_[frame] = *std::move(look);
    progress_.AddFrame();
    progress_.Tell(store_, "capturing");
  });
}

Status PlanTaker::TakeAgain(Error error, std::size_t frame, int attempt) {
  if (!MayTryAgain(error.code)) {
    return tl::unexpected(std::move(error));
  }
  if (Status rejected = Reject(frame, error.message); !rejected) {
    return rejected;
  }
  error.message = fmt::format("frame {} of {} ({}): {}{}", frame + 1, store_.Record().plan.size(),
                              NameOf(Planned(frame)), error.message,
                              attempt > 1 ? fmt::format("; tried {} times", attempt) : "");
  if (attempt == options_.tries || is_clipped_ || taker_.NeedsAPerson()) {
    return tl::unexpected(std::move(error));
  }
  return taker_.Recover(error);
}

Result<std::optional<std::size_t>> PlanTaker::TakeOpenFrames() {
  const std::vector<std::size_t> in_order = store_.Open();
  std::deque<std::size_t> open(in_order.begin(), in_order.end());
  std::vector<int> attempts(store_.Record().plan.size());
  std::optional<ArrivedFrame> arrived;  // checked while the next frame is being taken
  Status status;
  const auto again = [&](const Error& error, std::size_t frame) {
    open.push_front(frame);
    return TakeAgain(error, frame, attempts[frame]);
  };
  while (status && !brighter_ && (!open.empty() || arrived)) {
    std::optional<ArrivedFrame> next;
    if (!open.empty()) {
      const std::size_t frame = open.front();
      open.pop_front();
      progress_.Tell(store_, "capturing", NameOf(Planned(frame)), *Planned(frame).exposure_s);
      status = store_.BeginFrame(frame);
      Result<ArrivedFrame> taken =
          status ? Take(frame, ++attempts[frame]) : tl::unexpected(status.error());
      if (taken) {
        next = *std::move(taken);
      } else if (status) {
        status = again(taken.error(), frame);
      }
    }
    if (arrived) {
      const std::size_t frame = arrived->Frame();
      const Status settled = Settle(*std::exchange(arrived, std::nullopt));
      if (!settled) {
        const Status taken_again = again(settled.error(), frame);
        status = status ? taken_again : status;
      }
    }
    arrived = std::move(next);
  }
  if (arrived) {  // a frame that arrived before the failure is not lost
    const Status settled = Settle(*std::move(arrived));
    status = status && !settled && !brighter_ ? settled : status;
  }
  return status.map([&] { return brighter_; });
}

}  // namespace sateen
