#include "scanner/capture/preview.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "core/files/own_folder.h"
#include "imaging/color.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "rig/rig.h"
#include "scanner/capture/exposure_search.h"
#include "scanner/capture/frame_taker.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/frames/sensor_reading.h"

namespace sateen {
namespace {

constexpr double kPreviewPeak = 0.8;
constexpr int kMostPreviewTests = 8;
constexpr std::array<uint8_t, 3> kSaturatedInk = {255, 0, 255};

// Finds the light that is asked for, as the board switches it.
Result<std::optional<Light>> FindLight(const PreviewRequest& request,
                                       const std::optional<Rig>& rig) {
  if (!request.light) {
    return std::optional<Light>();
  }
  if (rig) {
    const auto found = std::ranges::find(rig->lights, *request.light, &Light::name);
    if (found != rig->lights.end()) {
      return std::optional<Light>(*found);
    }
  }
  Light light{.name = *request.light};
  const char* end = request.light->data() + request.light->size();
  const auto [rest, error] = std::from_chars(request.light->data(), end, light.channel);
  if (error != std::errc() || rest != end || light.channel < 0) {
    return Fail(ErrorCode::kBadData, "'{}' is not a channel{}", *request.light,
                rig ? fmt::format(", and {} has no light of that name", request.rig.string())
                    : "; to use names of lights, give a rig");
  }
  return std::optional<Light>(std::move(light));
}

// Balanced light of 2 x 2 sites, and whether one of them saturates.
struct Cell {
  std::array<float, 3> rgb = {};
  bool saturated = false;
};

Cell CellOf(const RawMosaic& mosaic, const SensorReading& reading, int x, int y) {
  Cell cell;
  std::array<float, 3> sites = {};
  for (size_t site = 0; site < mosaic.cfa.size(); ++site) {
    const size_t colour = mosaic.cfa[site];
    const float value =
        mosaic.samples.At(x + static_cast<int>(site % 2), y + static_cast<int>(site / 2));
    cell.rgb[colour] += reading.Value(value, colour);
    sites[colour] += 1.0F;
    cell.saturated = cell.saturated || value >= reading.saturation;
  }
  for (size_t c = 0; c < 3; ++c) {
    cell.rgb[c] /= sites[c];
  }
  return cell;
}

// Every step-th cell of 2 x 2 sites.
std::array<Image<uint8_t>, 3> Show(const RawMosaic& mosaic, const SensorReading& reading,
                                   int max_width) {
  const int cells_x = mosaic.samples.width / 2;
  const int step = (cells_x + max_width - 1) / max_width;
  const ImageSize size = {cells_x / step, mosaic.samples.height / 2 / step};
  std::array<Image<uint8_t>, 3> picture = {Image<uint8_t>(size.width, size.height),
                                           Image<uint8_t>(size.width, size.height),
                                           Image<uint8_t>(size.width, size.height)};
  const float white = reading.FullScale();
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const Cell cell = CellOf(mosaic, reading, 2 * step * x, 2 * step * y);
      for (size_t c = 0; c < 3; ++c) {
        const float shown = std::clamp(cell.rgb[c] / white, 0.0F, 1.0F);
        picture[c].At(x, y) =
            cell.saturated ? kSaturatedInk[c]
                           : static_cast<uint8_t>(std::lround(255.0F * SrgbFromLinear(shown)));
      }
    }
  }
  return picture;
}

struct Shot {
  ExposureSettings settings;
  RawMosaic mosaic;
  SensorReading reading;
};

// Takes one frame after another until the exposure is found, and returns that frame.
class PreviewShooter {
 public:
  PreviewShooter(std::optional<Light> light, std::optional<Response> response, FrameTaker& taker,
                 const std::filesystem::path& folder)
      : light_(std::move(light)), response_(std::move(response)), taker_(taker), folder_(folder) {}

  Result<Shot> Take(double exposure_s) {
    const Result<TakenFrame> taken = taker_.Take(light_, exposure_s, folder_ / "frame");
    Result<RawMosaic> mosaic = taken ? ReadRawMosaic(taken->path) : tl::unexpected(taken.error());
    if (!mosaic) {
      return tl::unexpected(mosaic.error());
    }
    FrameFile of{.path = taken->path, .response = response_};
    Result<SensorReading> reading = ReadingOf(of, *mosaic);
    if (!reading) {
      return tl::unexpected(reading.error());
    }
    if (!response_) {
      reading->balance = mosaic->camera_white_balance;
    }
    return Shot{taken->settings, *std::move(mosaic), *reading};
  }

  Result<Shot> Find() {
    constexpr double kLongestOfRoomLight_s = 10.0;
    const Result<double> longest_s =
        light_ ? taker_.LongestExposureOf({*light_}) : kLongestOfRoomLight_s;
    Result<ExposureSearch> search =
        longest_s ? ExposureSearch::Begin(
                        taker_.ExposureTimes(),
                        {.peak = kPreviewPeak, .low = 0.0, .most = 1, .longest_s = *longest_s})
                  : tl::unexpected(longest_s.error());
    for (int test = 0; search && test < kMostPreviewTests; ++test) {
      const double time_s = search->Found() ? search->Exposures()[0] : search->TestTime();
      Result<Shot> shot = Take(time_s);
      if (!shot || search->Found()) {
        return shot;
      }
      // A scene that cannot be exposed better is still worth a look.
      if (!search->Take(LevelsOf(shot->mosaic, shot->reading))) {
        return shot;
      }
    }
    return search ? Fail(ErrorCode::kDevice, "no exposure found with {} test frames; give one",
                         kMostPreviewTests)
                  : Result<Shot>(tl::unexpected(search.error()));
  }

 private:
  std::optional<Light> light_;
  std::optional<Response> response_;
  FrameTaker& taker_;
  const std::filesystem::path& folder_;
};

// Reads the rig of the request. Reads nothing if it names none.
Status ReadRigOf(const PreviewRequest& request, std::optional<Rig>& rig) {
  Status ready = request.Validate();
  if (ready && !request.rig.empty()) {
    ready = ReadRig(request.rig).map([&](Rig read) { rig = std::move(read); });
  }
  return ready;
}

}  // namespace

Status PreviewRequest::Validate() const {
  if (max_width < 16 || max_width > 16384) {
    return Fail(ErrorCode::kInvalidArgument, "max_width is {}; need 16 to 16384", max_width);
  }
  return CaptureOptions{.exposure_s = exposure_s, .f_number = f_number, .iso = iso, .level = level}
      .Validate();
}

Status CheckPreviewName(const std::filesystem::path& output) {
  const std::string ending = LowerCase(output.extension().string());
  return ending == ".jpg" || ending == ".jpeg"
             ? Status()
             : Fail(ErrorCode::kInvalidArgument,
                    "{}: a preview is a JPEG; give it a name that ends in .jpg or .jpeg",
                    output.string());
}

Status CheckPreview(const PreviewRequest& request) {
  std::optional<Rig> rig;
  return ReadRigOf(request, rig).and_then([&] {
    return FindLight(request, rig).map([](const std::optional<Light>&) {});
  });
}

Result<Preview> TakePreview(const PreviewRequest& request, RigDevices& devices, const Task& task) {
  std::optional<Rig> rig;
  const Status ready = ReadRigOf(request, rig);
  const Result<std::optional<Light>> light =
      ready ? FindLight(request, rig) : tl::unexpected(ready.error());
  if (!light) {
    return tl::unexpected(light.error());
  }
  const Result<OwnFolder> folder = MakeScratchFolder("preview");
  const Result<LightBoard*> board = folder ? devices.Board() : tl::unexpected(folder.error());
  const Result<TetheredCamera*> camera = board ? devices.Camera() : tl::unexpected(board.error());
  if (!camera) {
    return tl::unexpected(camera.error());
  }
  FrameTaker taker(**board, **camera,
                   {.f_number = request.f_number, .iso = request.iso, .level = request.level}, {},
                   task);
  PreviewShooter shooter(*light, rig ? rig->response : std::nullopt, taker, folder->Path());
  const Result<Shot> shot = request.exposure_s ? shooter.Take(*request.exposure_s) : shooter.Find();
  if (!shot) {
    devices.CloseCamera();
    return tl::unexpected(shot.error());
  }
  const auto picture = Show(shot->mosaic, shot->reading, request.max_width);
  return EncodeJpeg(picture).map([&](std::string jpeg) {
    return Preview{.jpeg = std::move(jpeg),
                   .size_px = picture[0].Size(),
                   .settings = shot->settings,
                   .levels = LevelsOf(shot->mosaic, shot->reading)};
  });
}

}  // namespace sateen
