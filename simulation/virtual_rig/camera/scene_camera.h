#pragma once

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/error.h"
#include "simulation/sensor.h"
#include "simulation/virtual_rig/board/light_log.h"
#include "simulation/virtual_rig/camera/lit_scene.h"
#include "simulation/virtual_rig/camera/scene_frame.h"
#include "simulation/virtual_rig/camera/virtual_camera.h"

namespace sateen {

// A frame as it was exposed, whatever a capture believes.
struct ExposedFrame {
  FrameRequest request;
  // Light by light, by what the pins did: the share of the exposure that it was on, times its
  // level, as far as it had risen. Lights of share 0 are left out.
  std::map<std::string, double> shares;
  size_t bytes = 0;
};

// The virtual camera's view of a lit scene: each frame is lit by what the board's pins did while
// the shutter was open. What can happen to a rig besides can be done to it. All calls may come from
// any thread.
class SceneCamera {
 public:
  // The exposure that Sensor::full_scale is of: H of 1/50 s, f/8, ISO 100.
  static constexpr double kReferenceExposure = 0.02 / (8.0 * 8.0);

  // `lights` must outlive this.
  SceneCamera(LitScene scene, const Sensor& sensor, const LightLog& lights);
  SceneCamera(const SceneCamera&) = delete;
  SceneCamera& operator=(const SceneCamera&) = delete;
  ~SceneCamera();

  // Returns a DNG file. It depends on what was lit, the settings, and what has been done to the
  // rig; not on the frame's number. Waits for a scene that is being read. Fails as
  // LightLog::MeanLevels().
  [[nodiscard]] Result<std::string> Frame(const FrameRequest& request);
  // Sets the function that is told of each frame, by the thread that asked for it.
  void OnExposed(std::function<void(const ExposedFrame&)> told);

  // Puts another object under the camera. kBadData, kIo: `dir` is no session of the same rig. It is
  // read in the background, then `told` how that went; after a failure the earlier scene stays.
  [[nodiscard]] Status ChangeScene(const std::filesystem::path& dir,
                                   std::function<void(const Status&)> told);

  // Returns the channel of a light by its name or number. kInvalidArgument names the lights.
  [[nodiscard]] Result<int> ChannelOf(const std::string& light) const;
  // Swaps two channels' wiring: each lights what the other one did.
  void Swap(int channel, int other);
  // Makes `channel` also light what `other` does.
  void Double(int channel, int other);
  // Makes the light that the rig has on this channel give `factor` of its light.
  void Dim(int channel, double factor);
  // Fails with kInvalidArgument if the scene has no ambient light that could be more.
  Status SetAmbient(double factor);
  // Moves the picture right and down by so many pixels, from now on.
  void Nudge(double dx_px, double dy_px);
  // Shades the next `frames` frames.
  void Shade(const PictureShade& shade, int frames);

 private:
  [[nodiscard]] FrameState NextState(const LitScene& scene, const std::vector<double>& levels,
                                     const FrameRequest& request);
  [[nodiscard]] ExposedFrame Exposed(const FrameRequest& request,
                                     const std::vector<double>& levels) const;
  std::shared_ptr<const LitScene> SceneWhenRead();

  const Sensor sensor_;
  const LightLog& lights_;
  const Rig rig_;  // rig of every scene
  const std::string first_folder_;
  std::atomic<bool> ends_ = false;

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable read_;
  std::shared_ptr<const LitScene> scene_;
  int scenes_to_read_ = 0;
  std::function<void(const ExposedFrame&)> told_;
  // Channel -> the channels whose lights it lights, as the rig has them; the same one may be there
  // twice.
  std::map<int, std::vector<int>> wiring_;
  std::map<int, double> factors_;  // factors other than 1, by light
  double ambient_ = 1.0;
  double shift_x_px_ = 0.0;
  double shift_y_px_ = 0.0;
  std::vector<std::pair<PictureShade, int>> shades_;  // with the number of frames left
  std::thread reader_;
};

}  // namespace sateen
