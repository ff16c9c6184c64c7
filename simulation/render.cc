#include "simulation/render.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>

#include "core/parallel.h"
#include "rig/projection.h"
#include "simulation/optics.h"
#include "simulation/random.h"
#include "simulation/trace.h"

namespace sateen {
namespace {

constexpr int kRenderRows = 8;
constexpr double kFarAway_mm = 1e6;   // a distant light, for shadows
constexpr double kBounceStep = 1e-3;  // share of the surface's detail; Monte-Carlo error is larger

// Streams of random numbers that must not meet.
enum Stream : uint64_t { kFlickerStream = 1, kYarnStream = 2, kBounceStream = 3 };

uint64_t StreamSeed(uint64_t seed, Stream stream) { return HashOf(seed, stream); }

Eigen::Vector3d VectorAt(const Image3& image, size_t pixel) {
  return Eigen::Vector3f(image[0].pixels[pixel], image[1].pixels[pixel], image[2].pixels[pixel])
      .cast<double>();
}

void SetVector(Image3& image, size_t pixel, const Eigen::Vector3d& value) {
  for (size_t c = 0; c < 3; ++c) {
    image[c].pixels[pixel] = static_cast<float>(value[static_cast<Eigen::Index>(c)]);
  }
}

// Returns the albedo of the body at a surface point, with its yarn's share of the variation.
Eigen::Vector3d BodyAlbedo(const Scene& scene, const SurfacePoint& point, double x_mm,
                           double y_mm) {
  const Material& material = scene.materials[static_cast<size_t>(point.part)];
  Eigen::Vector3d rho = AlbedoAt(material.albedo, x_mm, y_mm);
  if (material.yarn_variation > 0.0) {
    const auto yarn = static_cast<uint64_t>(static_cast<int64_t>(point.yarn) * 8 + point.part);
    const double share = 2.0 * UniformDeviate(StreamSeed(scene.seed, kYarnStream), yarn) - 1.0;
    rho = (rho * (1.0 + material.yarn_variation * share)).cwiseMin(1.0);
  }
  return rho;
}

std::optional<Eigen::Vector3d> SurfacePointOfPixel(const Scene& scene, double u, double v) {
  const Camera& camera = *scene.rig.camera;
  const std::optional<Eigen::Vector3d> direction = RayOfPixel(camera, u, v);
  if (!direction) {
    return std::nullopt;
  }
  const Ray ray{camera.table_from_camera.translation(), *direction};
  const std::optional<double> t = FirstHit(*scene.surface, ray);
  return t ? std::optional<Eigen::Vector3d>(ray.At(*t)) : std::nullopt;
}

// Returns false if the pixel does not see the surface.
bool MapPixel(const Scene& scene, int x, int y, const Eigen::Vector2d& shift_px,
              SurfaceMaps& maps) {
  const size_t pixel = maps.part.Index(x, y);
  const double u = x - shift_px.x();
  const double v = y - shift_px.y();
  const std::optional<Eigen::Vector3d> at = SurfacePointOfPixel(scene, u, v);
  if (!at) {
    return false;
  }
  const SurfacePoint seen = scene.surface->At(at->x(), at->y());
  SetVector(maps.point_mm, pixel, *at);
  SetVector(maps.normal, pixel, seen.Normal());
  maps.part.pixels[pixel] = static_cast<uint8_t>(seen.part);
  const int n = scene.lens.samples;
  Eigen::Vector3d rho = Eigen::Vector3d::Zero();
  for (int sample = 0; sample < n * n; ++sample) {
    // No two in one row or column, so that an edge along either is resolved to 1 / n^2 of a pixel.
    const int column = sample % n;
    const int row = sample / n;
    const double du = (column + (row + 0.5) / n) / n - 0.5;
    const double dv = (row + (column + 0.5) / n) / n - 0.5;
    const std::optional<Eigen::Vector3d> part_of_pixel =
        n == 1 ? at : SurfacePointOfPixel(scene, u + du, v + dv);
    if (!part_of_pixel) {
      return false;
    }
    rho += BodyAlbedo(scene, scene.surface->At(part_of_pixel->x(), part_of_pixel->y()),
                      part_of_pixel->x(), part_of_pixel->y());
  }
  SetVector(maps.albedo, pixel, rho / (n * n));
  return true;
}

Result<SurfaceMaps> MapSurface(const Scene& scene, const Eigen::Vector2d& shift_px,
                               const Task& task) {
  const ImageSize size = scene.rig.camera->size_px;
  SurfaceMaps maps{Image3(size), Image3(size), Image3(size), Image<uint8_t>(size), shift_px};
  std::atomic<bool> all_seen = true;
  const Status status = ParallelFor(size.height, kRenderRows, task, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < size.width; ++x) {
        if (!MapPixel(scene, x, y, shift_px, maps)) {
          all_seen = false;
        }
      }
    }
  });
  if (!status) {
    return tl::unexpected(status.error());
  }
  if (!all_seen) {
    return Fail(ErrorCode::kBadData,
                "the rig's camera has pixels that do not see the surface; need a camera that "
                "looks down on it, with a distortion that can be inverted");
  }
  return maps;
}

// Computes the light of one pixel of one frame.
class PixelShader {
 public:
  PixelShader(const Scene& scene, const SurfaceMaps& maps, std::optional<size_t> light)
      : scene_(scene),
        maps_(maps),
        eye_mm_(scene.rig.camera->table_from_camera.translation()),
        plain_(std::ranges::none_of(scene.materials,
                                    [](const Material& m) { return m.specular != nullptr; })) {
    if (!light) {
      return;
    }
    light_ = scene.rig.lights[*light];
    const auto& dead = scene.illumination.dead;
    const double gain = 1.0 + scene.illumination.flicker *
                                  NormalDeviate(StreamSeed(scene.seed, kFlickerStream), *light);
    light_->flux_rgb *=
        std::ranges::find(dead, light_->name) != dead.end() ? 0.0 : std::max(0.0, gain);
  }

  void Shade(size_t pixel, RenderedFrame& frame) const {
    const Eigen::Vector3d x_mm = VectorAt(maps_.point_mm, pixel);
    const Eigen::Vector3d n = VectorAt(maps_.normal, pixel).normalized();
    const Eigen::Vector3d rho = VectorAt(maps_.albedo, pixel);
    Eigen::Vector3d arriving = scene_.illumination.ambient_rgb;
    Eigen::Vector3d radiance = Eigen::Vector3d::Zero();
    if (light_) {
      const Incident in = IncidentAt(*light_, x_mm);
      const double cosine = Facing(n.dot(in.l));
      double visible = cosine > 0.0 ? 1.0 : 0.0;
      if (scene_.illumination.shadows == Shadows::kCast && cosine > 0.0) {
        visible = VisibleShare(pixel, x_mm);
      }
      frame.lit.pixels[pixel] = static_cast<uint8_t>(std::lround(255.0 * visible));
      const double share = cosine > 0.0 ? cosine * visible : cosine;
      radiance = in.e_rgb.cwiseProduct(Reflected(pixel, n, in.l, x_mm, rho)) * share;
      if (scene_.illumination.bounce_rays > 0) {
        arriving += Bounced(pixel, x_mm, n);
      }
    }
    SetVector(frame.radiance, pixel, radiance + rho.cwiseProduct(arriving));  // (1)
  }

 private:
  [[nodiscard]] double Facing(double cosine) const {
    return scene_.illumination.shadows == Shadows::kNone ? cosine : std::max(0.0, cosine);
  }

  // Returns pi f_r.
  [[nodiscard]] Eigen::Vector3d Reflected(size_t pixel, const Eigen::Vector3d& n,
                                          const Eigen::Vector3d& l, const Eigen::Vector3d& x_mm,
                                          const Eigen::Vector3d& rho) const {
    const Material& material = scene_.materials[maps_.part.pixels[pixel]];
    if (plain_ || material.specular == nullptr) {
      return rho;
    }
    return rho +
           std::numbers::pi * material.specular->Evaluate(n, l, (eye_mm_ - x_mm).normalized());
  }

  [[nodiscard]] bool SeesLight(const Eigen::Vector3d& x_mm, const Eigen::Vector3d& l) const {
    const double distance_mm =
        light_->model == LightModel::kDistant ? kFarAway_mm : (light_->position_mm - x_mm).norm();
    return IsVisible(*scene_.surface, x_mm, l, distance_mm);
  }

  // Returns the share of the places of a pixel's footprint on the surface that see the light; the
  // footprint is taken to be level.
  [[nodiscard]] double VisibleShare(size_t pixel, const Eigen::Vector3d& x_mm) const {
    const auto width = static_cast<size_t>(maps_.part.width);
    const size_t column = pixel % width;
    const size_t row = pixel / width;
    const double u = static_cast<double>(column) - maps_.shift_px.x();
    const double v = static_cast<double>(row) - maps_.shift_px.y();
    const int count = scene_.illumination.shadow_samples;
    int visible = 0;
    for (int sample = 0; sample < count * count; ++sample) {
      const double du = (sample % count + 0.5) / count - 0.5;
      const double dv = (sample / count + 0.5) / count - 0.5;  // NOLINT: whole rows of samples
      Eigen::Vector3d place =
          TablePointOfPixel(*scene_.rig.camera, u + du, v + dv, x_mm.z()).value_or(x_mm);
      place.z() = scene_.surface->At(place.x(), place.y()).height_mm;
      visible += SeesLight(place, IncidentAt(*light_, place).l) ? 1 : 0;
    }
    return static_cast<double>(visible) / (count * count);
  }

  // Returns (2), as irradiance.
  [[nodiscard]] Eigen::Vector3d Bounced(size_t pixel, const Eigen::Vector3d& x_mm,
                                        const Eigen::Vector3d& n) const {
    const int rays = scene_.illumination.bounce_rays;
    const auto side = static_cast<int>(std::lround(std::sqrt(rays)));
    const Eigen::Vector3d tangent = n.unitOrthogonal();
    const Eigen::Vector3d bitangent = n.cross(tangent);
    const uint64_t seed = HashOf(StreamSeed(scene_.seed, kBounceStream), pixel);
    Eigen::Vector3d from_mm = x_mm;  // x_mm is rounded to float: rays must not start below
    from_mm.z() = scene_.surface->At(x_mm.x(), x_mm.y()).height_mm;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int ray = 0; ray < side * side; ++ray) {  // one direction in each cell of a square
      const auto counter = 2 * static_cast<uint64_t>(ray);
      const double a = (ray % side + UniformDeviate(seed, counter)) / side;
      const double b = (ray / side + UniformDeviate(seed, counter + 1)) / side;  // NOLINT: rows
      const double radius = std::sqrt(a);
      const Eigen::Vector3d w = radius * std::cos(2.0 * std::numbers::pi * b) * tangent +
                                radius * std::sin(2.0 * std::numbers::pi * b) * bitangent +
                                std::sqrt(std::max(0.0, 1.0 - a)) * n;
      sum += DirectFrom({from_mm, w});
    }
    return sum / (side * side);
  }

  // Returns the light that the Lambertian body at the end of a ray sends back.
  [[nodiscard]] Eigen::Vector3d DirectFrom(const Ray& ray) const {
    const std::optional<double> t = NextHit(*scene_.surface, ray, kFarAway_mm, kBounceStep);
    if (!t) {
      return Eigen::Vector3d::Zero();
    }
    Eigen::Vector3d y_mm = ray.At(*t);
    const SurfacePoint hit = scene_.surface->At(y_mm.x(), y_mm.y());
    y_mm.z() = hit.height_mm;
    const Incident in = IncidentAt(*light_, y_mm);
    const double cosine = std::max(0.0, hit.Normal().dot(in.l));
    const bool lit =
        cosine > 0.0 && (scene_.illumination.shadows != Shadows::kCast || SeesLight(y_mm, in.l));
    return lit ? Eigen::Vector3d(cosine *
                                 in.e_rgb.cwiseProduct(BodyAlbedo(scene_, hit, y_mm.x(), y_mm.y())))
               : Eigen::Vector3d(Eigen::Vector3d::Zero());
  }

  const Scene& scene_;
  const SurfaceMaps& maps_;
  Eigen::Vector3d eye_mm_;
  bool plain_;  // nothing is specular
  std::optional<Light> light_;
};

// Returns the light from which on the camera stands elsewhere; past the last if it never does.
size_t BumpIndex(const Scene& scene) {
  const auto found = std::ranges::find(scene.rig.lights, scene.lens.bump_from, &Light::name);
  return static_cast<size_t>(found - scene.rig.lights.begin());
}

}  // namespace

Result<SceneRenderer> SceneRenderer::Create(const Scene& scene, const Task& task) {
  if (Status status = scene.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  SceneRenderer renderer(scene);
  Result<SurfaceMaps> maps = MapSurface(scene, Eigen::Vector2d::Zero(), task);
  if (!maps) {
    return tl::unexpected(maps.error());
  }
  renderer.maps_ = std::move(*maps);
  return renderer;
}

Result<RenderedFrame> SceneRenderer::Render(std::optional<size_t> light, const Task& task) {
  // The dark frame is the last.
  const size_t bump = BumpIndex(*scene_);
  const bool is_bumped = bump < scene_->rig.lights.size() && (!light || *light >= bump);
  if (is_bumped && !bumped_) {
    Result<SurfaceMaps> maps = MapSurface(*scene_, scene_->lens.bump_px, task);
    if (!maps) {
      return tl::unexpected(maps.error());
    }
    bumped_ = std::move(*maps);
  }
  const SurfaceMaps& maps = is_bumped ? *bumped_ : maps_;
  const ImageSize size = maps.part.Size();
  RenderedFrame frame{Image3(size), light ? Mask(size) : Mask()};
  const PixelShader shader(*scene_, maps, light);
  Status status = ParallelFor(size.height, kRenderRows, task, [&](int begin, int end) {
    for (size_t pixel = frame.radiance[0].Index(0, begin); pixel < frame.radiance[0].Index(0, end);
         ++pixel) {
      shader.Shade(pixel, frame);
    }
  });
  if (status) {
    status = ApplyOptics(scene_->lens, frame.radiance, task);
  }
  if (!status) {
    return tl::unexpected(status.error());
  }
  return frame;
}

}  // namespace sateen
