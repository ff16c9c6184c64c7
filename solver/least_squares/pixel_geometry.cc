#include "solver/least_squares/pixel_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace sateen {

Result<PixelLocator> PixelLocator::Make(const Rig& rig, const Image<float>* height_mm) {
  PixelLocator locator;
  if (!AllDistant(rig.lights)) {
    Result<TableGrid> grid = TableGrid::Make(*rig.camera);
    if (!grid) {
      return tl::unexpected(grid.error());
    }
    locator.grid_ = *std::move(grid);
    locator.height_mm_ = height_mm;
    locator.camera_mm_ = rig.camera->table_from_camera.translation().cast<float>();
  }
  if (std::ranges::any_of(
          rig.lights, [](const Light& light) { return light.model == LightModel::kLedField; })) {
    Result<GainRows> gains = GainRows::Make(*rig.camera, rig.lights);
    if (!gains) {
      return tl::unexpected(gains.error());
    }
    locator.gains_ = *std::move(gains);
    locator.lights_ = rig.lights;
  }
  return locator;
}

void PixelLocator::Locate(int begin, int end, PixelGeometry& geometry) const {
  if (!grid_) {
    return;
  }
  const auto width = static_cast<size_t>(grid_->Size().width);
  geometry.x_mm.resize(width * static_cast<size_t>(end - begin));
  geometry.y_mm.resize(geometry.x_mm.size());
  for (int row = begin; row < end; ++row) {
    const size_t start = width * static_cast<size_t>(row - begin);
    grid_->Row(row, std::span(geometry.x_mm).subspan(start, width),
               std::span(geometry.y_mm).subspan(start, width));
  }
  if (height_mm_ != nullptr) {
    Raise(begin, geometry);
  }
  if (gains_) {
    FillGains(begin, end, geometry);
  }
}

void PixelLocator::Raise(int begin, PixelGeometry& geometry) const {
  const float* const z_mm = height_mm_->pixels.data() + height_mm_->Index(0, begin);
  geometry.z_mm.assign(z_mm, z_mm + geometry.x_mm.size());
  for (size_t p = 0; p < geometry.z_mm.size(); ++p) {
    const float part = geometry.z_mm[p] / camera_mm_.z();
    geometry.x_mm[p] += (camera_mm_.x() - geometry.x_mm[p]) * part;  // (1)
    geometry.y_mm[p] += (camera_mm_.y() - geometry.y_mm[p]) * part;
  }
}

void PixelLocator::FillGains(int begin, int end, PixelGeometry& geometry) const {
  const auto width = static_cast<size_t>(grid_->Size().width);
  const size_t pixels = geometry.x_mm.size();
  geometry.gains.resize(pixels * lights_.size());
  geometry.places.assign(lights_.size(), nullptr);
  for (size_t k = 0; k < lights_.size(); ++k) {
    if (!gains_->Has(k)) {
      continue;
    }
    const std::span<float> of_light = std::span(geometry.gains).subspan(k * pixels, pixels);
    geometry.places[k] = of_light.data();
    for (int row = begin; height_mm_ == nullptr && row < end; ++row) {
      gains_->Row(k, row, of_light.subspan(width * static_cast<size_t>(row - begin), width));
    }
    for (size_t p = 0; p < geometry.z_mm.size(); ++p) {
      const Eigen::Vector3d x_mm =
          Eigen::Vector3f(geometry.x_mm[p], geometry.y_mm[p], geometry.z_mm[p]).cast<double>();
      of_light[p] = static_cast<float>(
          1.0 / lights_[k].field.At(ShadowOnTable(lights_[k].position_mm, x_mm)));
    }
  }
}

Status CheckHeight(const Image<float>* height_mm, const Rig& rig, ImageSize size) {
  if (height_mm == nullptr) {
    return {};
  }
  if (height_mm->Size() != size) {
    return Fail(ErrorCode::kBadData, "the heights are {}x{} px but the frames are {}x{} px",
                height_mm->width, height_mm->height, size.width, size.height);
  }
  float most = -std::numeric_limits<float>::infinity();
  for (const float z : height_mm->pixels) {
    if (!std::isfinite(z)) {
      return Fail(ErrorCode::kBadData, "a height is {}; need finite numbers", z);
    }
    most = std::max(most, z);
  }
  const auto is_below = [&](const Eigen::Vector3d& x_mm, std::string_view what) -> Status {
    if (static_cast<double>(most) < x_mm.z()) {
      return {};
    }
    return Fail(ErrorCode::kBadData,
                "the surface rises to {:.4g} mm, but {} is at {:.4g} mm; need it below", most, what,
                x_mm.z());
  };
  Status status = rig.camera && rig.camera->has_pose
                      ? is_below(rig.camera->table_from_camera.translation(), "the camera")
                      : Status();
  for (size_t k = 0; status && k < rig.lights.size(); ++k) {
    if (rig.lights[k].model != LightModel::kDistant) {
      status = is_below(rig.lights[k].position_mm, fmt::format("lights[{}]", k));
    }
  }
  return status;
}

}  // namespace sateen
