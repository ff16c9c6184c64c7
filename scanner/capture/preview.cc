#include "scanner/capture/preview.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "core/scratch_folder.h"
#include "imaging/color.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "rig/rig.h"
#include "scanner/capture/exposure_search.h"
#include "scanner/capture/lit_exposure.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/sensor_reading.h"

namespace sateen {
namespace {

constexpr double kPreviewPeak = 0.8;
constexpr int kMostPreviewTests = 8;
constexpr std::array<uint8_t, 3> kSaturatedInk = {255, 0, 255};

// The light that is asked for, as the board switches it.
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
    return Fail(ErrorCode::kBadData, "'{}' is no channel{}", *request.light,
                rig ? fmt::format(", and {} has no light of that name", request.rig.string())
                    : "; names of lights are looked up in a rig");
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

// One frame after another until the exposure is found, and that frame.
class PreviewShooter {
 public:
  PreviewShooter(const PreviewRequest& request, const Light* light,
                 const std::optional<Response>& response, LightBoard& board, TetheredCamera& camera,
                 const Task& task)
      : request_(request),
        light_(light),
        response_(response),
        board_(board),
        camera_(camera),
        task_(task) {}

  Result<Shot> Take(double exposure_s, const std::filesystem::path& folder) {
    const Result<ExposureSettings> set = camera_.Configure(
        {.exposure_s = exposure_s, .f_number = request_.f_number, .iso = request_.iso});
    const Result<LitFrame> lit =
        set ? ExposeLit(board_, camera_, {light_, request_.level, set->exposure_s}, {}, folder,
                        task_)
            : tl::unexpected(set.error());
    Result<RawMosaic> mosaic = lit ? ReadRawMosaic(lit->file.path) : tl::unexpected(lit.error());
    if (!mosaic) {
      return tl::unexpected(mosaic.error());
    }
    FrameFile of{.path = lit->file.path, .response = response_};
    Result<SensorReading> reading = ReadingOf(of, *mosaic);
    if (!reading) {
      return tl::unexpected(reading.error());
    }
    if (!response_) {
      reading->balance = mosaic->camera_white_balance;
    }
    return Shot{*set, *std::move(mosaic), *reading};
  }

  Result<Shot> Find(const std::filesystem::path& folder) {
    const double longest_s = light_ != nullptr ? LongestExposure(board_.Info(), *light_, {}) : 10.0;
    Result<ExposureSearch> search = ExposureSearch::Begin(
        camera_.ExposureTimes(),
        {.peak = kPreviewPeak, .low = 0.0, .most = 1, .longest_s = longest_s});
    for (int test = 0; search && test < kMostPreviewTests; ++test) {
      const double time_s = search->Found() ? search->Exposures()[0] : search->TestTime();
      Result<Shot> shot = Take(time_s, folder);
      if (!shot || search->Found()) {
        return shot;
      }
      // What cannot be exposed better is still worth a look.
      if (!search->Take(LevelsOf(shot->mosaic, shot->reading))) {
        return shot;
      }
    }
    return search ? Fail(ErrorCode::kDevice, "no exposure found in {} test frames; give one",
                         kMostPreviewTests)
                  : Result<Shot>(tl::unexpected(search.error()));
  }

 private:
  const PreviewRequest& request_;
  const Light* light_;
  const std::optional<Response>& response_;
  LightBoard& board_;
  TetheredCamera& camera_;
  const Task& task_;
};

// Nothing where the request names none.
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
  const ScratchFolder folder("preview");
  const Result<LightBoard*> board = folder.Create().and_then([&] { return devices.Board(); });
  const Result<TetheredCamera*> camera = board ? devices.Camera() : tl::unexpected(board.error());
  if (!camera) {
    return tl::unexpected(camera.error());
  }
  const std::optional<Response> response = rig ? rig->response : std::nullopt;
  PreviewShooter shooter(request, *light ? &**light : nullptr, response, **board, **camera, task);
  const Result<Shot> shot = request.exposure_s ? shooter.Take(*request.exposure_s, folder.Path())
                                               : shooter.Find(folder.Path());
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
