#include "simulation/virtual_rig/camera/scene_camera.h"

#include <algorithm>
#include <utility>

#include "imaging/dng.h"

namespace sateen {
namespace {

double ExposureOf(const FrameRequest& request) {
  return request.exposure_s * (request.iso / 100.0) / (request.f_number * request.f_number);
}

bool HasLight(const Image<float>& picture) {
  return std::ranges::any_of(picture.pixels, [](float value) { return value > 0.0F; });
}

}  // namespace

SceneCamera::SceneCamera(LitScene scene, const Sensor& sensor, const LightLog& lights)
    : sensor_(sensor),
      lights_(lights),
      rig_(scene.rig),
      first_folder_(scene.folder),
      scene_(std::make_shared<const LitScene>(std::move(scene))) {
  for (const Light& light : rig_.lights) {
    wiring_[light.channel] = {light.channel};
  }
}

SceneCamera::~SceneCamera() {
  ends_ = true;
  if (reader_.joinable()) {
    reader_.join();
  }
}

void SceneCamera::OnExposed(std::function<void(const ExposedFrame&)> told) {
  const std::lock_guard lock(mutex_);
  told_ = std::move(told);
}

Result<std::string> SceneCamera::Frame(const FrameRequest& request) {
  const Result<std::vector<double>> levels = lights_.MeanLevels(request.begin, request.end);
  if (!levels) {
    return tl::unexpected(levels.error());
  }
  const std::shared_ptr<const LitScene> scene = SceneWhenRead();
  const FrameState state = NextState(*scene, *levels, request);
  Result<std::string> bytes =
      EncodeDng(FrameOfScene(*scene, sensor_, state), {.cfa = sensor_.cfa,
                                                       .black = sensor_.black_dn,
                                                       .white = sensor_.white_dn,
                                                       .model = rig_.camera->model,
                                                       .exposure_s = request.exposure_s,
                                                       .f_number = request.f_number,
                                                       .iso = request.iso});
  std::function<void(const ExposedFrame&)> told;
  {
    const std::lock_guard lock(mutex_);
    told = told_;
  }
  if (bytes && told) {
    ExposedFrame frame = Exposed(request, *levels);
    frame.bytes = bytes->size();
    told(frame);
  }
  return bytes;
}

ExposedFrame SceneCamera::Exposed(const FrameRequest& request,
                                  const std::vector<double>& levels) const {
  ExposedFrame frame{.request = request};
  for (size_t channel = 0; channel < levels.size(); ++channel) {
    if (levels[channel] > 0.0) {
      const auto light = std::ranges::find(rig_.lights, static_cast<int>(channel), &Light::channel);
      frame.shares[light != rig_.lights.end() ? light->name : fmt::format("channel {}", channel)] =
          levels[channel];
    }
  }
  return frame;
}

FrameState SceneCamera::NextState(const LitScene& scene, const std::vector<double>& levels,
                                  const FrameRequest& request) {
  const std::lock_guard lock(mutex_);
  FrameState state{.shares = std::vector<double>(scene.lights.size()),
                   .ambient = ambient_,
                   .exposure = ExposureOf(request) / kReferenceExposure,
                   .shift_x_px = shift_x_px_,
                   .shift_y_px = shift_y_px_};
  for (size_t k = 0; k < scene.lights.size(); ++k) {
    const int own = scene.rig.lights[k].channel;
    for (const auto& [channel, lit] : wiring_) {
      const auto times = static_cast<double>(std::ranges::count(lit, own));
      state.shares[k] += times * levels.at(static_cast<size_t>(channel));
    }
    if (const auto factor = factors_.find(own); factor != factors_.end()) {
      state.shares[k] *= factor->second;
    }
  }
  for (auto& [shade, frames] : shades_) {
    state.shades.push_back(shade);
    --frames;
  }
  std::erase_if(shades_, [](const auto& shade) { return shade.second == 0; });
  return state;
}

std::shared_ptr<const LitScene> SceneCamera::SceneWhenRead() {
  std::unique_lock lock(mutex_);
  read_.wait(lock, [this] { return scenes_to_read_ == 0; });
  return scene_;
}

Status SceneCamera::ChangeScene(const std::filesystem::path& dir,
                                std::function<void(const Status&)> told) {
  const Result<Rig> rig = ReadSceneRig(dir);
  Status same =
      rig ? RequireSameRig(*rig, dir.string(), rig_, first_folder_) : tl::unexpected(rig.error());
  if (!same) {
    return same;
  }
  const std::lock_guard lock(mutex_);
  ++scenes_to_read_;
  reader_ = std::thread([this, dir, told = std::move(told), former = std::move(reader_)]() mutable {
    if (former.joinable()) {
      former.join();  // the last one asked for is the last one read
    }
    Result<LitScene> scene = ReadLitScene(dir, sensor_, {.cancel = &ends_});
    Status status;
    {
      const std::lock_guard inner_lock(mutex_);
      if (scene) {
        scene_ = std::make_shared<const LitScene>(*std::move(scene));
      } else {
        status = tl::unexpected(scene.error());
      }
      --scenes_to_read_;
    }
    read_.notify_all();
    told(status);
  });
  return {};
}

Result<int> SceneCamera::ChannelOf(const std::string& light) const {
  std::string names;
  for (const Light& known : rig_.lights) {
    if (light == known.name || light == std::to_string(known.channel)) {
      return known.channel;
    }
    names += (names.empty() ? "" : ", ") + known.name;
  }
  return Fail(ErrorCode::kInvalidArgument,
              "'{}' is no light of the scene; need one of {}, or its channel", light, names);
}

void SceneCamera::Swap(int channel, int other) {
  const std::lock_guard lock(mutex_);
  std::swap(wiring_.at(channel), wiring_.at(other));
}

void SceneCamera::Double(int channel, int other) {
  const std::lock_guard lock(mutex_);
  const std::vector<int> more = wiring_.at(other);
  std::vector<int>& lit = wiring_.at(channel);
  lit.insert(lit.end(), more.begin(), more.end());
}

void SceneCamera::Dim(int channel, double factor) {
  const std::lock_guard lock(mutex_);
  factors_[channel] = factor;
}

Status SceneCamera::SetAmbient(double factor) {
  std::shared_ptr<const LitScene> scene;
  {
    const std::lock_guard lock(mutex_);
    scene = scene_;
  }
  if (factor != 0.0 && factor != 1.0 && !HasLight(scene->ambient)) {
    return Fail(ErrorCode::kInvalidArgument,
                "{}: its dark frame is black, so {:g} times its ambient light is none; render the "
                "scene with illumination.ambient_rgb, and use factor 0 where there shall be none",
                scene->folder, factor);
  }
  const std::lock_guard lock(mutex_);
  ambient_ = factor;
  return {};
}

void SceneCamera::Nudge(double dx_px, double dy_px) {
  const std::lock_guard lock(mutex_);
  shift_x_px_ += dx_px;
  shift_y_px_ += dy_px;
}

void SceneCamera::Shade(const PictureShade& shade, int frames) {
  const std::lock_guard lock(mutex_);
  shades_.emplace_back(shade, frames);
}

}  // namespace sateen
