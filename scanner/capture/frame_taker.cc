#include "scanner/capture/frame_taker.h"

#include <algorithm>
#include <limits>
#include <system_error>
#include <utility>

#include "scanner/capture/lit_exposure.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

Status MakeEmptyFolder(const fs::path& path) {
  std::error_code error;  // a file that cannot be removed is in nobody's way
  fs::remove_all(path, error);
  fs::create_directories(path, error);
  if (error) {
    return Fail(ErrorCode::kIo, "{}: cannot create this folder: {}", path.string(),
                error.message());
  }
  return {};
}

}  // namespace

bool MayTryAgain(ErrorCode code) {
  return code == ErrorCode::kBadData || code == ErrorCode::kDevice || code == ErrorCode::kTimeout;
}

FrameTaker::FrameTaker(LightBoard& board, TetheredCamera& camera, const FrameSettings& settings,
                       const CaptureOptions& options, const Task& task)
    : board_(board), camera_(camera), settings_(settings), options_(options), task_(task) {}

Result<ExposureSettings> FrameTaker::Configure(double exposure_s) {
  if (configured_ && configured_->asked_s == exposure_s) {
    return configured_->settings;
  }
  configured_.reset();
  Result<ExposureSettings> set = camera_.Configure(
      {.exposure_s = exposure_s, .f_number = settings_.f_number, .iso = settings_.iso});
  if (set) {
    configured_ = Configured{exposure_s, *set};
  }
  return set;
}

Result<TakenFrame> FrameTaker::Take(const std::optional<Light>& light, double exposure_s,
                                    const fs::path& folder) {
  const Result<ExposureSettings> set =
      MakeEmptyFolder(folder).and_then([&] { return Configure(exposure_s); });
  if (!set) {
    return tl::unexpected(set.error());
  }
  return ExposeLit(board_, camera_, {light, settings_.level, set->exposure_s}, options_, folder,
                   task_)
      .map([&](const LitFrame& shot) {
        return TakenFrame{shot.file.path, *set, shot.camera_s};
      });
}

Status FrameTaker::TurnOff() { return ConfirmDark(board_); }

Status FrameTaker::Recover(const Error& error) {
  if (error.code != ErrorCode::kDevice && error.code != ErrorCode::kTimeout) {
    return {};
  }
  configured_.reset();
  const Result<CameraInfo> again = camera_.Open();
  return again ? Status()
               : Fail(again.error().code, "{}; and then: {}", error.message, again.error().message);
}

Result<double> FrameTaker::LongestExposureOf(const std::vector<Light>& lights) {
  if (board_.state() != LightBoard::State::kReady) {
    if (const Status connected = board_.Connect(); !connected) {
      return tl::unexpected(connected.error());
    }
  }
  double longest_s = std::numeric_limits<double>::infinity();
  for (const Light& light : lights) {
    longest_s = std::min(longest_s, LongestExposure(board_.Info(), light, options_));
  }
  return longest_s;
}

}  // namespace sateen
