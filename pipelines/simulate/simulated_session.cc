#include "pipelines/simulate/simulated_session.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/sha256.h"
#include "imaging/dng.h"
#include "imaging/image_io.h"
#include "imaging/show/pictures.h"
#include "scanner/sessions/files/pose_json.h"
#include "simulation/random.h"
#include "simulation/render.h"

namespace sateen {
namespace {

constexpr const char* kDarkFrame = "dark";
constexpr int kPanelPx = 240;  // width in the overview
constexpr int kSmallestRawPx = 22;
constexpr int kPanelColumns = 5;
constexpr uint64_t kSensorStream = 1000;  // one stream of noise a frame from here on
constexpr uint64_t kStreamsPerTake = 1'000'000;

// One exposure of a light, or of the dark.
struct Take {
  double exposure_s = 0.0;
  std::string suffix;  // of the file's name: empty where there is only one
};

class SessionWriter {
 public:
  SessionWriter(const SceneFile& file, FrameFormat format, const Task& task, OutputFolder& folder)
      : file_(file), format_(format), task_(task), folder_(folder) {
    session_.kind = file.kind;
    if (file.kind == SessionKind::kSheet && !file.target_is_printed) {
      session_.table_from_sheet = file.table_from_target;
    }
  }

  Status Write() {
    const Lights& lights = file_.scene.rig.lights;
    if (std::ranges::find(lights, kDarkFrame, &Light::name) != lights.end()) {
      return Fail(ErrorCode::kBadData,
                  "a light of the rig is named '{}', as the dark frame is; rename the light",
                  kDarkFrame);
    }
    const ImageSize size = file_.scene.rig.camera->size_px;
    if (format_ == FrameFormat::kRawDng && std::min(size.width, size.height) < kSmallestRawPx) {
      return Fail(ErrorCode::kBadData,
                  "the rig's camera.size_px is [{}, {}]; RAW files need at least {} each: LibRaw "
                  "reads no smaller ones; use --linear",
                  size.width, size.height, kSmallestRawPx);
    }
    const ExposureRecord& exposure = file_.exposure;
    if (format_ == FrameFormat::kLinearExr &&
        (!exposure.series_s.empty() || exposure.repeats > 1)) {
      return Fail(ErrorCode::kInvalidArgument,
                  "exposure.{} is of RAW frames, and --linear gives radiance; use one or the other",
                  exposure.series_s.empty() ? "repeats" : "series_s");
    }
    RetireFormerSession();
    task_.BeginStage("geometry", file_.scene.rig.camera->size_px.height);
    Result<SceneRenderer> renderer = SceneRenderer::Create(file_.scene, task_);
    if (!renderer) {
      return tl::unexpected(renderer.error());
    }
    Status status = WriteTruth(renderer->Maps());
    for (size_t k = 0; k <= lights.size() && status; ++k) {
      const std::optional<size_t> light = k < lights.size() ? std::optional(k) : std::nullopt;
      status = WriteFrame(*renderer, light);
    }
    return status.and_then([&] { return WriteOverview(renderer->Maps()); }).and_then([&] {
      return WriteRecord();
    });
  }

 private:
  // Frames of lights that the session in this folder had and this one has not.
  void RetireFormerSession() {
    const Result<Session> former = ReadSession(folder_.Dir());
    if (!former) {
      return;  // none, or one that is no business of ours
    }
    for (const SessionFrame& frame : former->frames) {
      if (std::filesystem::path(frame.file).parent_path() == "frames") {
        folder_.Retire(frame.file);
      }
      if (!frame.light.empty() && frame.light.find('/') == std::string::npos) {
        folder_.Retire("truth/lit/" + frame.light + ".png");
      }
    }
  }

  Status WriteTruth(const SurfaceMaps& maps) {
    return WriteExr(folder_.Stage("truth/normal.exr"), maps.normal)
        .and_then([&] { return WriteExr(folder_.Stage("truth/albedo.exr"), maps.albedo); })
        .and_then([&] { return WriteExr(folder_.Stage("truth/height.exr"), maps.point_mm[2]); });
  }

  Status WriteFrame(SceneRenderer& renderer, std::optional<size_t> light) {
    const std::string name = NameOf(light);
    task_.BeginStage("rendering " + name, file_.scene.rig.camera->size_px.height);
    const Result<RenderedFrame> frame = renderer.Render(light, task_);
    if (!frame) {
      return tl::unexpected(frame.error());
    }
    if (panels_.empty()) {
      white_ = WhiteOf(frame->radiance);
    }
    panels_.push_back(Shrunk(ShowLinear(frame->radiance, white_), kPanelPx));
    Status status;
    const std::vector<Take> takes = TakesOf(light);
    for (size_t take = 0; take < takes.size() && status; ++take) {
      status = WriteTake(frame->radiance, light, takes[take], take);
    }
    if (status && light) {
      status = WritePng8(folder_.Stage("truth/lit/" + name + ".png"), frame->lit);
    }
    return status;
  }

  [[nodiscard]] std::string NameOf(std::optional<size_t> light) const {
    return light ? file_.scene.rig.lights[*light].name : kDarkFrame;
  }

  // Every exposure of the series for the lights that have it; the shortest and the longest one for
  // the dark; each as often as asked.
  [[nodiscard]] std::vector<Take> TakesOf(std::optional<size_t> light) const {
    const ExposureRecord& record = file_.exposure;
    std::vector<double> times_s = record.series_s;
    const bool has_series =
        !light || record.series_light.empty() || record.series_light == NameOf(light);
    if (times_s.empty() || !has_series) {
      times_s = {record.exposure_s};
    } else if (!light) {
      const auto [shortest, longest] = std::ranges::minmax(times_s);
      times_s = shortest < longest ? std::vector<double>{shortest, longest} : std::vector{longest};
    }
    std::vector<Take> takes;
    for (const double time_s : times_s) {
      for (int repeat = 1; repeat <= record.repeats; ++repeat) {
        const bool is_alone = record.series_s.empty() && record.repeats == 1;
        takes.push_back({time_s, is_alone ? "" : fmt::format("-{:g}s-{}", time_s, repeat)});
      }
    }
    return takes;
  }

  Status WriteTake(const Image3& radiance, std::optional<size_t> light, const Take& take,
                   size_t index) {
    const std::string stem = "frames/" + NameOf(light) + take.suffix;
    const bool is_raw = format_ == FrameFormat::kRawDng;
    folder_.Retire(stem + (is_raw ? ".exr" : ".dng"));
    const std::string written = stem + (is_raw ? ".dng" : ".exr");
    const std::filesystem::path staged = folder_.Stage(written);
    Status status =
        is_raw ? WriteRaw(staged, radiance, light, take, index) : WriteExr(staged, radiance);
    if (!status) {
      return status;
    }
    const Result<std::string> sha256 = Sha256OfFile(staged);
    if (!sha256) {
      return tl::unexpected(sha256.error());
    }
    SessionFrame record{.role = light ? FrameRole::kLit : FrameRole::kDark,
                        .light = light ? NameOf(light) : "",
                        .file = written,
                        .sha256 = *sha256};
    if (is_raw) {
      record.exposure_s = take.exposure_s;
      record.f_number = file_.exposure.f_number;
      record.iso = file_.exposure.iso;
    }
    session_.frames.push_back(std::move(record));
    return {};
  }

  Status WriteRaw(const std::filesystem::path& path, const Image3& radiance,
                  std::optional<size_t> light, const Take& take, size_t index) {
    const uint64_t stream =
        kSensorStream + kStreamsPerTake * index + (light ? *light : file_.scene.rig.lights.size());
    Sensor sensor = file_.sensor;
    sensor.full_scale *= file_.exposure.exposure_s / take.exposure_s;
    const Result<Image<uint16_t>> mosaic =
        Expose(sensor, radiance, HashOf(file_.scene.seed, stream), task_);
    if (!mosaic) {
      return tl::unexpected(mosaic.error());
    }
    return WriteDng(path, *mosaic,
                    {.cfa = file_.sensor.cfa,
                     .black = file_.sensor.black_dn,
                     .white = file_.sensor.white_dn,
                     .make = "Sateen",
                     .model = file_.scene.rig.camera->model,
                     .exposure_s = take.exposure_s,
                     .f_number = file_.exposure.f_number,
                     .iso = file_.exposure.iso});
  }

  // To look at: all frames, equally exposed, then normals, albedo and height.
  Status WriteOverview(const SurfaceMaps& maps) {
    for (const Rgb8& panel :
         {ShowNormal(maps.normal), ShowLinear(maps.albedo, 1.0F), ShowRelief(maps.point_mm[2])}) {
      panels_.push_back(Shrunk(panel, kPanelPx));
    }
    return WritePng8(folder_.Stage("overview.png"), ContactSheet(panels_, kPanelColumns));
  }

  // The rig in the units of the frames, and the record that names it.
  Status WriteRecord() {
    Rig rig = file_.scene.rig;
    if (format_ == FrameFormat::kRawDng) {
      const double exposure = SessionFrame{.exposure_s = file_.exposure.exposure_s,
                                           .f_number = file_.exposure.f_number,
                                           .iso = file_.exposure.iso}
                                  .Exposure();
      for (Light& light : rig.lights) {
        light.flux_rgb =
            light.flux_rgb.cwiseProduct(Eigen::Vector3d(file_.sensor.sensitivity_rgb.data())) /
            (file_.sensor.full_scale * exposure);
      }
      Response response{.black = file_.sensor.black_dn, .white = file_.sensor.white_dn};
      if (file_.sensor.full_well_electrons) {
        const double gain = (response.white - response.black) / *file_.sensor.full_well_electrons;
        response.gain_dn_per_electron = gain;
        response.read_noise_dn = gain * file_.sensor.read_noise_electrons;
      }
      rig.response = response;
    }
    Rig true_rig = rig;
    if (rig.response) {
      true_rig.response->white = file_.sensor.saturation_dn.value_or(file_.sensor.white_dn);
    }
    if (file_.kind == SessionKind::kChart) {
      rig.response.reset();  // which is what a chart is captured for
    }
    const std::string rig_json = RigToJson(rig);
    session_.rig = "rig.json";
    session_.rig_sha256 = Sha256(rig_json);
    return folder_.WriteText("rig.json", rig_json)
        .and_then([&] { return folder_.WriteText("truth/rig.json", RigToJson(true_rig)); })
        .and_then([&] { return WriteTruePose(); })
        .and_then([&] { return folder_.WriteText("session.json", SessionToJson(session_)); });
  }

  Status WriteTruePose() {
    if (!file_.table_from_target) {
      folder_.Retire(kTruePoseFile);
      return {};
    }
    return folder_.WriteText(kTruePoseFile, TruePoseToJson(*file_.table_from_target));
  }

  const SceneFile& file_;
  FrameFormat format_;
  const Task& task_;
  OutputFolder& folder_;
  Session session_;
  std::vector<Rgb8> panels_;
  float white_ = 1.0F;
};

}  // namespace

Status StageSimulatedSession(const SceneFile& file, FrameFormat format, const Task& task,
                             OutputFolder& folder) {
  return SessionWriter(file, format, task, folder).Write();
}

}  // namespace sateen
