#include "simulation/relief.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/parallel.h"
#include "rig/projection.h"
#include "simulation/random.h"

namespace sateen {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

// Returns the sensor's reading of `radiance`, as radiance again.
double Sensed(const SensorModel& sensor, double radiance, uint64_t seed, uint64_t sample) {
  const double mean = std::clamp(radiance / sensor.full_scale, 0.0, 4.0) * sensor.electrons;
  const double sigma = std::sqrt(mean + sensor.read_noise_electrons * sensor.read_noise_electrons);
  const double read = mean + sigma * NormalDeviate(seed, sample);
  const double top = std::exp2(sensor.bits) - 1.0;
  // A real converter has an offset, so that noise around black survives; it is subtracted here.
  const double number = std::min(std::round(read / sensor.electrons * top), top);
  return number / top * sensor.full_scale;
}

Eigen::Vector3d Tilted(const Eigen::Vector2d& towards, double slope_rad) {
  const double length = towards.norm();
  if (length == 0.0) {
    return Eigen::Vector3d::UnitZ();
  }
  const Eigen::Vector2d side = towards / length * std::sin(slope_rad);
  return {side.x(), side.y(), std::cos(slope_rad)};
}

// Returns the normal at u, v in [-1, 1] across the shorter side of the image, v up.
Eigen::Vector3d NormalAt(const ReliefScene& scene, double u, double v, double period) {
  switch (scene.shape) {
    case ReliefShape::kFlat:
      return Eigen::Vector3d::UnitZ();
    case ReliefShape::kDome: {
      const double r = std::hypot(u, v);
      // A cap: the sine of the tilt grows with the radius.
      return r > 1.0 ? Eigen::Vector3d::UnitZ()
                     : Tilted({u, v}, std::asin(r * std::sin(scene.max_slope_rad)));
    }
    case ReliefShape::kRipple: {
      const Eigen::Vector2d wave(std::sin(kTwoPi * u / period), std::sin(kTwoPi * v / period));
      return Tilted(wave, scene.max_slope_rad * wave.norm() / std::numbers::sqrt2);
    }
  }
  return Eigen::Vector3d::UnitZ();
}

Eigen::Vector3d AlbedoAt(const ReliefScene& scene, double u, double v) {
  const Eigen::Vector3d phase(u + v, u - v + 1.0, 2.0 * v);
  const Eigen::Array3d wave = 0.5 + 0.5 * (3.0 * phase.array()).sin();
  return scene.albedo_min + (scene.albedo_max - scene.albedo_min) * wave;
}

// Renders and keeps one row; everything of it depends on its pixels alone.
class RowRenderer {
 public:
  RowRenderer(const ReliefScene& scene, const Rig& rig, ImageSize size, RenderedRelief& out)
      : scene_(scene),
        rig_(rig),
        size_(size),
        half_(0.5 * std::min(size.width, size.height)),
        out_(out) {}

  // Returns false if a pixel does not see the table.
  [[nodiscard]] bool Render(int row) const {
    for (int column = 0; column < size_.width; ++column) {
      std::optional<Eigen::Vector3d> x_mm = Eigen::Vector3d::Zero();
      if (rig_.camera) {
        x_mm = TablePointOfPixel(*rig_.camera, column, row);
      }
      if (!x_mm) {
        return false;
      }
      RenderPixel(column, row, *x_mm);
    }
    return true;
  }

 private:
  void RenderPixel(int column, int row, const Eigen::Vector3d& x_mm) const {
    const double u = (column - 0.5 * (size_.width - 1)) / half_;
    const double v = (0.5 * (size_.height - 1) - row) / half_;
    // The albedo rounded as its map is; the normal must stay of unit length.
    const Eigen::Vector3d n = NormalAt(scene_, u, v, scene_.ripple_period_px / half_).normalized();
    const Eigen::Vector3d rho = AlbedoAt(scene_, u, v).cast<float>().cast<double>();
    const size_t pixel = out_.normal[0].Index(column, row);
    for (size_t c = 0; c < 3; ++c) {
      const auto i = static_cast<Eigen::Index>(c);
      out_.normal[c].pixels[pixel] = static_cast<float>(n[i]);
      out_.albedo[c].pixels[pixel] = static_cast<float>(rho[i]);
    }
    for (size_t k = 0; k < rig_.lights.size(); ++k) {
      const Incident in = IncidentAt(rig_.lights[k], x_mm);
      for (size_t c = 0; c < 3; ++c) {
        const auto i = static_cast<Eigen::Index>(c);
        double radiance = rho[i] * in.e_rgb[i] * std::max(0.0, n.dot(in.l));  // (1)
        if (scene_.sensor) {
          radiance = Sensed(*scene_.sensor, radiance, scene_.seed,
                            (pixel * rig_.lights.size() + k) * 3 + c);
        }
        out_.stack[k].rgb[c].pixels[pixel] = static_cast<float>(radiance);
      }
    }
  }

  const ReliefScene& scene_;
  const Rig& rig_;
  ImageSize size_;
  double half_;
  RenderedRelief& out_;
};

Status CheckRig(const Rig& rig, ImageSize size) {
  if (Status status = rig.Validate("rig"); !status) {
    return status;
  }
  if (rig.camera && rig.camera->size_px != size) {
    return Fail(ErrorCode::kBadData, "the rig's camera has {}x{} px; need {}x{} px",
                rig.camera->size_px.width, rig.camera->size_px.height, size.width, size.height);
  }
  return {};
}

}  // namespace

std::optional<ReliefShape> ReliefShapeNamed(std::string_view name) {
  if (name == "flat") {
    return ReliefShape::kFlat;
  }
  if (name == "dome") {
    return ReliefShape::kDome;
  }
  if (name == "ripple") {
    return ReliefShape::kRipple;
  }
  return std::nullopt;
}

Status ReliefScene::Validate() const {
  const auto fail = [](std::string_view field, double value, std::string_view range) {
    return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", field, value, range);
  };
  if (!(max_slope_rad >= 0.0 && max_slope_rad < std::numbers::pi / 2.0)) {
    return fail("max_slope_rad", max_slope_rad, "0 <= max_slope_rad < pi/2");
  }
  if (!(ripple_period_px > 0.0)) {
    return fail("ripple_period_px", ripple_period_px, "ripple_period_px > 0");
  }
  if (!(albedo_min > 0.0 && albedo_min <= albedo_max)) {
    return fail("albedo_min", albedo_min, "0 < albedo_min <= albedo_max");
  }
  if (!(albedo_max <= 1.0)) {
    return fail("albedo_max", albedo_max, "albedo_max <= 1");
  }
  if (sensor && !(sensor->full_scale > 0.0)) {
    return fail("sensor.full_scale", sensor->full_scale, "full_scale > 0");
  }
  if (sensor && !(sensor->bits >= 1 && sensor->bits <= 16)) {
    return fail("sensor.bits", sensor->bits, "1 <= bits <= 16");
  }
  if (sensor && !(sensor->electrons > 0.0)) {
    return fail("sensor.electrons", sensor->electrons, "electrons > 0");
  }
  if (sensor && !(sensor->read_noise_electrons >= 0.0)) {
    return fail("sensor.read_noise_electrons", sensor->read_noise_electrons,
                "read_noise_electrons >= 0");
  }
  return {};
}

Result<RenderedRelief> RenderRelief(const ReliefScene& scene, const Rig& rig, ImageSize size,
                                    const Task& task) {
  if (Status status = scene.Validate().and_then([&] { return CheckRig(rig, size); }); !status) {
    return tl::unexpected(status.error());
  }
  RenderedRelief out{{}, Image3(size), Image3(size)};
  for (const Light& light : rig.lights) {
    LightFrame frame{.rgb = Image3(size), .name = light.name};
    if (scene.sensor) {
      frame.full_scale = static_cast<float>(scene.sensor->full_scale);
    }
    out.stack.push_back(std::move(frame));
  }
  const RowRenderer renderer(scene, rig, size, out);
  std::vector<uint8_t> row_is_off_table(static_cast<size_t>(size.height), 0);
  task.BeginStage("rendering", size.height);
  const Status status = ParallelFor(size.height, 1, task, [&](int begin, int end) {
    for (int row = begin; row < end; ++row) {
      row_is_off_table[static_cast<size_t>(row)] = renderer.Render(row) ? 0 : 1;
    }
  });
  if (!status) {
    return tl::unexpected(status.error());
  }
  if (std::find(row_is_off_table.begin(), row_is_off_table.end(), 1) != row_is_off_table.end()) {
    return Fail(ErrorCode::kBadData, "the rig's camera has pixels that do not see the table");
  }
  return out;
}

}  // namespace sateen
