#pragma once

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "imaging/dng.h"
#include "rig/projection.h"
#include "rig/rig.h"
#include "scanner/capture/capture_session.h"
#include "simulation/rigs.h"
#include "simulation/sensor.h"
#include "simulation/virtual_rig/board/simulated_port.h"
#include "simulation/virtual_rig/board/virtual_board.h"
#include "tests/simulation/virtual_rig/board_talk.h"
#include "tests/testing/files.h"

// A capture without hardware in simulated time: the board's real firmware, and a camera that sees
// what its pins light.
namespace sateen::testing {

inline constexpr ImageSize kCapturePx = {96, 64};
inline constexpr double kCaptureScale = 1.5;  // radiance that saturates

inline Rig CaptureRig() {
  Rig rig = RingRig(kCapturePx, LightModel::kLed);
  rig.calibration.lights.emplace();
  return rig;
}

// Returns the camera's picture of each channel alone: the table, painted with a pattern.
inline std::vector<Image3> LightImages(const Rig& rig) {
  std::vector<Image3> images;
  for (const Light& light : rig.lights) {
    Image3 image(kCapturePx);
    for (int y = 0; y < kCapturePx.height; ++y) {
      for (int x = 0; x < kCapturePx.width; ++x) {
        const Incident incident = IncidentAt(light, *TablePointOfPixel(*rig.camera, x, y));
        const double albedo = (x * 7 + y * 13) % 11 < 5 ? 0.3 : 0.6;
        for (size_t c = 0; c < 3; ++c) {
          image[c].At(x, y) = static_cast<float>(
              albedo * incident.e_rgb[static_cast<Eigen::Index>(c)] * incident.l.z());
        }
      }
    }
    images.push_back(std::move(image));
  }
  return images;
}

// The picture is what the lights give on average over the exposure. Frames of the same light are
// the same bits.
class LitCamera : public TetheredCamera {
 public:
  LitCamera(VirtualBoard& board, std::vector<Image3> images)
      : board_(board), images_(std::move(images)) {}

  std::vector<Result<void>> fail_next;          // failures of the next captures, last first
  std::function<void(int capture)> on_exposed;  // middle of an exposure; captures from 0
  std::vector<size_t> image_of_channel;         // another wiring; empty: as the rig has it
  std::vector<double> times_s;                  // times that it says it has
  // True if the picture gets brighter with the exposure time; the images are for 20 ms.
  bool exposure_counts = false;
  bool needs_a_person = false;  // its answer after a failure
  int captures = 0;
  int opened = 0;

  Result<CameraInfo> Open() override {
    ++opened;
    return CameraInfo{.model = "simulated"};
  }
  Result<ExposureSettings> Configure(const ExposureSettings& settings) override {
    settings_ = settings;
    return settings;
  }
  [[nodiscard]] std::vector<double> ExposureTimes() const override { return times_s; }
  Result<CapturedFile> Capture(const std::filesystem::path& folder,
                               std::chrono::milliseconds /*deadline*/) override {
    const int capture = captures++;
    if (!fail_next.empty()) {
      const Status failure = fail_next.back();
      fail_next.pop_back();
      if (!failure) {
        return tl::unexpected(failure.error());
      }
    }
    const Image3 radiance = See(capture);
    Sensor sensor = *SensorNamed("nikon-d5100");
    sensor.full_scale = kCaptureScale;
    const Result<Image<uint16_t>> mosaic = Expose(sensor, radiance, /*seed=*/7, {.threads = 1});
    const std::filesystem::path path = folder / fmt::format("DSC_{:04}.DNG", capture);
    const Status written = WriteDng(path, *mosaic,
                                    {.cfa = sensor.cfa,
                                     .black = sensor.black_dn,
                                     .white = sensor.white_dn,
                                     .exposure_s = settings_.exposure_s,
                                     .f_number = settings_.f_number,
                                     .iso = settings_.iso});
    if (!written) {
      return tl::unexpected(written.error());
    }
    return CapturedFile{.path = path, .name_on_camera = path.filename()};
  }
  [[nodiscard]] bool NeedsAPerson() const override { return needs_a_person; }
  void Close() noexcept override {}

 private:
  Image3 See(int capture) {
    constexpr int kSteps = 4;
    Image3 seen(kCapturePx);
    for (int step = 0; step < kSteps; ++step) {
      board_.RunFor(
          std::chrono::microseconds(static_cast<int64_t>(settings_.exposure_s * 1e6 / kSteps)));
      if (step == 1 && on_exposed) {
        on_exposed(capture);
      }
      for (const int channel : board_.Lit()) {
        const auto k = static_cast<size_t>(channel);
        const size_t image = image_of_channel.empty() ? k : image_of_channel.at(k);
        const double gain = exposure_counts ? settings_.exposure_s / 0.02 : 1.0;
        const auto share = static_cast<float>(gain * board_.Level(channel) / kSteps);
        for (size_t c = 0; c < 3 && share > 0.0F; ++c) {
          for (size_t p = 0; p < seen[c].pixels.size(); ++p) {
            seen[c].pixels[p] += share * images_.at(image)[c].pixels[p];
          }
        }
      }
    }
    return seen;
  }

  VirtualBoard& board_;
  std::vector<Image3> images_;
  ExposureSettings settings_;
};

// Returns the exposure times of a camera of third stops. [s]
inline std::vector<double> ThirdStops() {
  std::vector<double> times_s;
  for (double time_s = 0.0005; time_s < 2.0; time_s *= std::cbrt(2.0)) {
    times_s.push_back(time_s);
  }
  return times_s;
}

inline CaptureOptions QuickCapture() {
  CaptureOptions options;
  options.exposure_s = 0.02;
  options.settle = milliseconds(5);
  options.keep_alive = milliseconds(0);
  return options;
}

}  // namespace sateen::testing
