#include "simulation/virtual_rig/camera/rig_camera.h"

#include <sys/resource.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <utility>

namespace sateen {
namespace {

constexpr const char* kDefaultSensor = "nikon-d5100";
constexpr int kNiceOfFrames = 5;  // the board's thread comes first: it has to keep real time

std::string ExposureEvent(const ExposedFrame& frame) {
  const FrameRequest& request = frame.request;
  return fmt::format(R"("event":"exposure","number":{},"exposure_s":{:.6g},"f_number":{:.4g},)"
                     R"("iso":{:.6g},"lit":{},"bytes":{})",
                     request.number, request.exposure_s, request.f_number, request.iso,
                     nlohmann::json(frame.shares).dump(), frame.bytes);
}

}  // namespace

Result<Sensor> SensorOf(const RigCameraOptions& options, const Rig& rig) {
  const std::optional<Sensor> named =
      SensorNamed(options.sensor.empty() ? kDefaultSensor : options.sensor);
  if (!named) {
    return Fail(ErrorCode::kInvalidArgument, "'{}' is no sensor; need {}", options.sensor,
                kDefaultSensor);
  }
  Sensor sensor = options.sensor.empty() ? SensorOfRig(rig, *named) : *named;
  sensor.full_scale = options.full_scale;
  sensor.black_dn = options.black_dn.value_or(sensor.black_dn);
  if (const Status status = sensor.Validate(); !status) {
    return Fail(ErrorCode::kInvalidArgument, "the camera's sensor: {}", status.error().message);
  }
  return sensor;
}

Result<std::unique_ptr<RigCamera>> RigCamera::Start(const RigCameraOptions& options, LightLog& log,
                                                    const RigLoop& loop, RigCommands& commands,
                                                    const Task& task) {
  const Result<Rig> rig = ReadSceneRig(options.scene);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  const Result<Sensor> sensor = SensorOf(options, *rig);
  if (!sensor) {
    return tl::unexpected(sensor.error());
  }
  Result<LitScene> scene = ReadLitScene(options.scene, *sensor, task);
  if (!scene) {
    return tl::unexpected(scene.error());
  }
  std::unique_ptr<RigCamera> camera(new RigCamera(log));
  camera->scene_ = std::make_unique<SceneCamera>(*std::move(scene), *sensor, log);
  if (const Status ambient = camera->scene_->SetAmbient(options.ambient); !ambient) {
    return tl::unexpected(ambient.error());
  }
  camera->scene_->OnExposed([&commands, &loop](const ExposedFrame& frame) {
    commands.Post([&loop, event = ExposureEvent(frame)] { loop.Say(event); });
  });
  auto frame = [&commands, view = camera->scene_.get()](const FrameRequest& request) {
    setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceOfFrames);  // this thread alone
    Result<std::string> bytes = view->Frame(request);
    if (!bytes) {
      commands.Failed(bytes.error());
    }
    return bytes;
  };
  auto responder = PtpResponder::Start(
      {.persona = options.persona, .source = std::move(frame), .asked = [&commands](int number) {
         commands.CaptureAsked(number);
       }});
  if (!responder) {
    return tl::unexpected(responder.error());
  }
  camera->responder_ = *std::move(responder);
  commands.HasCamera(*camera->scene_, camera->responder_->Camera());
  return camera;
}

RigCamera::~RigCamera() {
  log_.Close();  // or an exposure under way waits for a board that runs no longer
}

}  // namespace sateen
