#include "simulation/virtual_rig/camera/lit_scene.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/parallel.h"
#include "imaging/image_io.h"
#include "scanner/sessions/frames/frame_loader.h"
#include "scanner/sessions/session_layout.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr const char* kHowToRender = "render it with sateen simulate SCENE --linear -o DIR";

// Reads (1) of one frame.
Result<Image<float>> ReadSites(const FrameFile& file, const Sensor& sensor, ImageSize size_px) {
  if (const auto hash = CheckedHash(file); !hash) {
    return tl::unexpected(hash.error());
  }
  const Result<Photo> photo = ReadPhoto(file.path);
  if (!photo) {
    return tl::unexpected(photo.error());
  }
  if (photo->saturation) {
    return Fail(ErrorCode::kBadData, "{}: is a file of integers; need linear float radiance: {}",
                file.path.string(), kHowToRender);
  }
  if (photo->rgb.Size() != size_px) {
    return Fail(ErrorCode::kBadData, "{}: is {}x{} px, the camera of the scene's rig {}x{}; {}",
                file.path.string(), photo->rgb.Size().width, photo->rgb.Size().height,
                size_px.width, size_px.height, kHowToRender);
  }
  Image<float> sites(size_px);
  for (int y = 0; y < size_px.height; ++y) {
    for (int x = 0; x < size_px.width; ++x) {
      const uint8_t colour = sensor.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)];
      const auto i = static_cast<double>(photo->rgb[colour].At(x, y));
      if (!std::isfinite(i)) {
        return Fail(ErrorCode::kBadData, "{}: the pixel at ({}, {}) is not a finite number; {}",
                    file.path.string(), x, y, kHowToRender);
      }
      sites.At(x, y) =
          static_cast<float>(sensor.sensitivity_rgb[colour] * i / sensor.full_scale);  // (1)
    }
  }
  return sites;
}

// Returns the session's frames: one of each light, then the dark ones.
Result<std::vector<FrameFile>> FramesOf(const fs::path& dir, const ReadPlan& plan) {
  if (!plan.rig.camera || plan.rig.lights.empty()) {
    return Fail(ErrorCode::kBadData, "{}: its rig has no {}; need a rig with both", dir.string(),
                plan.rig.camera ? "lights" : "camera");
  }
  std::vector<FrameFile> frames;
  for (size_t k = 0; k < plan.lit.size(); ++k) {
    if (plan.lit[k].size() != 1) {
      return Fail(ErrorCode::kBadData,
                  "{}: has {} frames of light '{}'; need one of each light: {}", dir.string(),
                  plan.lit[k].size(), plan.rig.lights[k].name, kHowToRender);
    }
    frames.push_back(plan.lit[k][0]);
  }
  if (plan.dark.empty()) {
    return Fail(ErrorCode::kBadData, "{}: has no dark frame; {}", dir.string(), kHowToRender);
  }
  frames.insert(frames.end(), plan.dark.begin(), plan.dark.end());
  for (const SessionFrame& frame : plan.session->frames) {
    if (frame.exposure_s || frame.f_number || frame.iso) {
      return Fail(ErrorCode::kBadData,
                  "{}: frame {} was exposed; need radiance as it is before any camera: {}",
                  dir.string(), frame.file, kHowToRender);
    }
  }
  return frames;
}

}  // namespace

Result<LitScene> ReadLitScene(const fs::path& dir, const Sensor& sensor, const Task& task) {
  if (const Status status = sensor.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  Result<ReadPlan> plan = PlanSession(dir, {});
  if (!plan) {
    return tl::unexpected(plan.error());
  }
  const Result<std::vector<FrameFile>> files = FramesOf(dir, *plan);
  if (!files) {
    return tl::unexpected(files.error());
  }
  const ImageSize size_px = plan->rig.camera->size_px;
  std::vector<Result<Image<float>>> sites(files->size());
  const Status ran =
      ParallelFor(static_cast<int>(files->size()), 1, task, [&](int begin, int /*end*/) {
        const auto k = static_cast<size_t>(begin);
        sites[k] = ReadSites((*files)[k], sensor, size_px);
      });
  if (!ran) {
    return tl::unexpected(ran.error());
  }
  for (const Result<Image<float>>& frame : sites) {
    if (!frame) {
      return tl::unexpected(frame.error());
    }
  }
  LitScene scene{.folder = dir.string(), .ambient = Image<float>(size_px)};
  const size_t light_count = plan->rig.lights.size();
  const float weight = 1.0F / static_cast<float>(sites.size() - light_count);
  for (size_t k = light_count; k < sites.size(); ++k) {
    for (size_t p = 0; p < size_px.PixelCount(); ++p) {
      scene.ambient.pixels[p] += weight * sites[k]->pixels[p];
    }
  }
  for (size_t k = 0; k < light_count; ++k) {
    for (size_t p = 0; p < size_px.PixelCount(); ++p) {
      sites[k]->pixels[p] -= scene.ambient.pixels[p];
    }
    scene.lights.push_back(*std::move(sites[k]));
  }
  scene.rig = std::move(plan->rig);
  return scene;
}

Result<Rig> ReadSceneRig(const fs::path& dir) {
  Result<ReadPlan> plan = PlanSessionRig(dir, {});
  if (!plan) {
    return tl::unexpected(plan.error());
  }
  return std::move(plan->rig);
}

Status RequireSameRig(const Rig& rig, const std::string& what, const Rig& other_rig,
                      const std::string& other) {
  if (rig.lights.size() != other_rig.lights.size()) {
    return Fail(ErrorCode::kBadData, "{}: has {} lights, {} has {}; need a scene of the same rig",
                what, rig.lights.size(), other, other_rig.lights.size());
  }
  for (const Light& light : rig.lights) {
    const auto found = std::ranges::find(other_rig.lights, light.name, &Light::name);
    if (found == other_rig.lights.end()) {
      return Fail(ErrorCode::kBadData, "{}: light '{}' is not in {}; need a scene of the same rig",
                  what, light.name, other);
    }
    if (found->channel != light.channel) {
      return Fail(ErrorCode::kBadData,
                  "{}: light '{}' is on channel {}, in {} on {}; need a scene of the same rig",
                  what, light.name, light.channel, other, found->channel);
    }
  }
  const auto size_of = [](const Rig& r) { return r.camera ? r.camera->size_px : ImageSize(); };
  const ImageSize size = size_of(rig);
  const ImageSize other_size = size_of(other_rig);
  if (size != other_size) {
    return Fail(ErrorCode::kBadData,
                "{}: its camera has {}x{} px, that of {} {}x{}; need a scene of the same rig", what,
                size.width, size.height, other, other_size.width, other_size.height);
  }
  return {};
}

Sensor SensorOfRig(const Rig& rig, const Sensor& otherwise) {
  Sensor sensor = otherwise;
  if (!rig.response) {
    return sensor;
  }
  const Response& response = *rig.response;
  sensor.black_dn = response.black;
  sensor.white_dn = response.white;
  sensor.bits = response.white < 4096.0 ? 12 : response.white < 16384.0 ? 14 : 16;
  if (response.gain_dn_per_electron) {
    sensor.full_well_electrons = (response.white - response.black) / *response.gain_dn_per_electron;
    sensor.read_noise_electrons =
        response.read_noise_dn.value_or(0.0) / *response.gain_dn_per_electron;
  }
  return sensor;
}

}  // namespace sateen
