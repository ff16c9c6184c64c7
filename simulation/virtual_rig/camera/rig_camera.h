#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "core/error.h"
#include "simulation/virtual_rig/board/light_log.h"
#include "simulation/virtual_rig/camera/ptp_responder.h"
#include "simulation/virtual_rig/camera/scene_camera.h"
#include "simulation/virtual_rig/rig_commands.h"
#include "simulation/virtual_rig/rig_loop.h"

namespace sateen {

struct RigCameraOptions {
  std::string scene;              // folder of a session of linear frames
  std::string persona = "nikon";  // or "generic"
  std::string sensor;             // its name; empty: the scene's rig's response, else "nikon-d5100"
  std::optional<double> black_dn;  // reading in the dark, instead of the sensor's own
  // Radiance that reads as white at 1/50 s, f/8 and ISO 100.
  double full_scale = 1.5;
  double ambient = 1.0;  // times the scene's
  // Time constant with which a light goes on and off.
  std::chrono::nanoseconds rise = std::chrono::milliseconds(1);
};

// The camera of the virtual rig's program: a responder on the loopback interface, whose frames are
// of a scene that the board lights. `log`, `loop` and `commands` must outlive it.
class RigCamera {
 public:
  // Errors of ReadLitScene(), PtpResponder::Start(), SceneCamera::SetAmbient(), SensorOf().
  static Result<std::unique_ptr<RigCamera>> Start(const RigCameraOptions& options, LightLog& log,
                                                  const RigLoop& loop, RigCommands& commands,
                                                  const Task& task = {});
  RigCamera(const RigCamera&) = delete;
  RigCamera& operator=(const RigCamera&) = delete;
  ~RigCamera();

  // Returns the port by which libgphoto2 finds it.
  [[nodiscard]] std::string PortName() const { return responder_->PortName(); }

 private:
  explicit RigCamera(LightLog& log) : log_(log) {}

  LightLog& log_;
  std::unique_ptr<SceneCamera> scene_;
  std::unique_ptr<PtpResponder> responder_;
};

// Returns the sensor of a scene's rig as `options` say. kInvalidArgument: no such sensor, a level
// out of range.
[[nodiscard]] Result<Sensor> SensorOf(const RigCameraOptions& options, const Rig& rig);

}  // namespace sateen
