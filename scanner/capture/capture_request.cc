#include "scanner/capture/capture_request.h"

#include <algorithm>
#include <cmath>
#include <system_error>

#include "scanner/capture/session_folder.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kBytesOfSite = 2;  // RAW without compression
constexpr ImageSize kUnknownSize = {6000, 4000};

// Returns the free space for a folder that exists or is to be created.
std::uintmax_t FreeBytes(const fs::path& dir) {
  std::error_code error;
  fs::path existing = fs::absolute(dir, error);
  while (!existing.empty() && !fs::exists(existing, error) && existing != existing.root_path()) {
    existing = existing.parent_path();
  }
  const fs::space_info space = fs::space(existing, error);
  return error ? UINTMAX_MAX : space.available;
}

std::uintmax_t BytesOf(const Rig& rig, std::size_t frames) {
  const ImageSize size = rig.camera ? rig.camera->size_px : kUnknownSize;
  return kBytesOfSite * size.PixelCount() * frames;
}

Status CheckRoom(const Rig& rig, std::size_t frames, const fs::path& dir) {
  const std::uintmax_t bytes = BytesOf(rig, frames);
  const std::uintmax_t room = FreeBytes(dir);
  if (room < bytes) {
    return Fail(ErrorCode::kIo,
                "{}: has room for {} MB, and {} frames of this camera need about {} MB; make room, "
                "or choose another folder",
                dir.string(), room / 1'000'000, frames, bytes / 1'000'000);
  }
  return {};
}

// Fails unless the board can switch each light of the rig, at that level and for that long.
Status CheckChannels(const Rig& rig, const LightBoard& board, double level,
                     const CaptureOptions& options) {
  const std::vector<LightLimits>& limits = board.Info().lights;
  for (const Light& light : rig.lights) {
    if (light.channel < 0 || static_cast<std::size_t>(light.channel) >= limits.size()) {
      return Fail(ErrorCode::kBadData,
                  "light '{}' of the rig is on channel {}, but the board at {} has channels 0 to "
                  "{}; correct the rig, or flash the firmware for 16 lights",
                  light.name, light.channel, board.PortName(), limits.size() - 1);
    }
    const double most = limits[static_cast<std::size_t>(light.channel)].max_level;
    if (level > most) {
      return Fail(ErrorCode::kInvalidArgument,
                  "the level of {:.4g} % is above the {:.4g} % that the board allows light '{}'; "
                  "use --level {:.4g}%, or raise the limit: sateen light limits {}",
                  100.0 * level, 100.0 * most, light.name, 100.0 * most, light.channel);
    }
    const std::chrono::duration<double> on =
        limits[static_cast<std::size_t>(light.channel)].max_on - options.settle;
    if (options.exposure_s.value_or(0.0) >= on.count()) {
      return Fail(ErrorCode::kInvalidArgument,
                  "an exposure of {:.4g} s is longer than the board lets light '{}' be on, {:.4g} "
                  "s; expose shorter, or raise the limit if the LED bears it: sateen light limits "
                  "{} --max-on TIME",
                  *options.exposure_s, light.name, on.count(), light.channel);
    }
  }
  return {};
}

struct OpenDevices {
  LightBoard* board;
  TetheredCamera* camera;
};

Result<OpenDevices> OpenFor(const Rig& rig, double level, const CaptureOptions& options,
                            RigDevices& devices) {
  const Result<LightBoard*> board = devices.Board();
  const Status channels =
      board ? CheckChannels(rig, **board, level, options) : tl::unexpected(board.error());
  if (!channels) {
    return tl::unexpected(channels.error());
  }
  return devices.Camera().map([&](TetheredCamera* camera) { return OpenDevices{*board, camera}; });
}

// Returns the options with the exposure of the journal.
CaptureOptions OptionsOf(const CaptureSession& session, const CaptureRequest& request) {
  CaptureOptions options = request.options;
  options.exposure_s = session.AskedExposure();
  return options;
}

Result<CaptureSession> BeginOrResume(const CaptureRequest& request) {
  if (!request.resume) {
    return CaptureSession::Begin(request.output, request.rig, request.options);
  }
  Result<CaptureSession> session = CaptureSession::Resume(request.output, request.options);
  const Status changed = session && request.new_exposure
                             ? session->ChangeExposure(request.options.exposure_s)
                             : Status();
  return changed ? std::move(session) : tl::unexpected(changed.error());
}

// Opens the devices before a folder is created that a capture without devices would leave behind.
Result<OpenDevices> OpenBefore(const CaptureRequest& request, RigDevices& devices) {
  return CheckBegin(request.output, request.rig, request.options).and_then([&](const Rig& rig) {
    return CheckRoom(rig, PlanOf(rig, {1.0}).size(), request.output).and_then([&] {
      return OpenFor(rig, request.options.level, request.options, devices);
    });
  });
}

}  // namespace

Status CheckCapture(const CaptureRequest& request) {
  if (!request.resume) {
    return CheckBegin(request.output, request.rig, request.options).map([](const Rig&) {});
  }
  return CheckResume(request.output).and_then([&](const Journal& journal) {
    return request.new_exposure && journal.complete
               ? Status(tl::unexpected(CompleteSessionError(request.output)))
               : Status();
  });
}

Result<CaptureSummary> RunCapture(const CaptureRequest& request, RigDevices& devices,
                                  const Task& task, const CaptureObserver& observer) {
  if (!request.resume) {
    if (const Result<OpenDevices> open = OpenBefore(request, devices); !open) {
      return tl::unexpected(open.error());
    }
  }
  Result<CaptureSession> session = BeginOrResume(request);
  if (!session) {
    return tl::unexpected(session.error());
  }
  if (session->Record().complete) {
    return session->Finish();
  }
  const Result<OpenDevices> open = OpenFor(session->GetRig(), session->Record().begun.level,
                                           OptionsOf(*session, request), devices);
  if (!open) {
    return tl::unexpected(session->WithNextStep(open.error()));
  }
  Result<CaptureSummary> summary = session->Run(*open->board, *open->camera, task, observer);
  if (!summary) {
    devices.CloseCamera();
  }
  return summary;
}

Result<CaptureForecast> ForecastCapture(const CaptureRequest& request, RigDevices& devices) {
  const Result<Rig> rig = CheckBegin(request.output, request.rig, request.options);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  CaptureForecast forecast{.request = request,
                           .plan = PlanOf(*rig, {request.options.exposure_s.value_or(1.0)}),
                           .exposure_known = request.options.exposure_s.has_value()};
  forecast.bytes = BytesOf(*rig, forecast.plan.size());
  forecast.free_bytes = FreeBytes(request.output);
  const Result<OpenDevices> open = OpenBefore(request, devices);
  if (!open) {
    return tl::unexpected(open.error());
  }
  forecast.port = open->board->PortName();
  forecast.firmware = open->board->Info().build_id;
  forecast.camera = devices.OpenCamera().value_or(CameraInfo{});
  ExposureSettings wanted{.f_number = request.options.f_number, .iso = request.options.iso};
  const std::vector<double> times_s = open->camera->ExposureTimes();
  wanted.exposure_s = request.options.exposure_s.value_or(
      times_s.empty() ? wanted.exposure_s : times_s[times_s.size() / 2]);
  const Result<ExposureSettings> set = open->camera->Configure(wanted);
  if (!set) {
    return tl::unexpected(set.error());
  }
  forecast.settings = *set;
  return forecast;
}

}  // namespace sateen
