#include "solver/least_squares/pixel_system.h"

#include <algorithm>
#include <cmath>

#include "imaging/color.h"
#include "rig/projection.h"

namespace sateen {

Eigen::Vector3d LuminanceWeights() {
  return {static_cast<double>(kLuminance[0]), static_cast<double>(kLuminance[1]),
          static_cast<double>(kLuminance[2])};
}

float ClipThreshold(const LightFrame& frame, const LambertianOptions& options) {
  return static_cast<float>(options.clip_level * static_cast<double>(frame.full_scale));
}

float DarkThreshold(const LightFrame& frame, const LambertianOptions& options) {
  return std::isfinite(frame.full_scale)
             ? static_cast<float>(options.dark_level * static_cast<double>(frame.full_scale))
             : 0.0F;
}

PixelSystem::PixelSystem(const FramesInput& input, const LambertianOptions& options)
    : input_(input),
      options_(options),
      needs_position_(!AllDistant(input.rig.lights)),
      l_(static_cast<Eigen::Index>(input.stack.size()), 3),
      rhs_(static_cast<Eigen::Index>(input.stack.size()), 4),
      e_(static_cast<Eigen::Index>(input.stack.size()), 3),
      frames_(input.stack.size()) {}

std::optional<Eigen::Vector3d> PixelSystem::TablePoint(int column, int row) const {
  if (!needs_position_) {
    return Eigen::Vector3d::Zero();
  }
  return TablePointOfPixel(*input_.rig.camera, column, row, input_.HeightAt(column, row));
}

void PixelSystem::Gather(int column, int row) {
  const std::optional<Eigen::Vector3d> x_mm = TablePoint(column, row);
  const size_t pixel = input_.stack[0].rgb[0].Index(column, row);
  count_ = 0;
  saturated_ = 0;
  bright_ = false;
  double brightest = 0.0;
  for (size_t k = 0; x_mm && k < input_.stack.size(); ++k) {
    const LightFrame& frame = input_.stack[k];
    const Eigen::Vector3f i(frame.rgb[0].pixels[pixel], frame.rgb[1].pixels[pixel],
                            frame.rgb[2].pixels[pixel]);
    if (!i.allFinite()) {
      continue;
    }
    bright_ = bright_ || i.maxCoeff() > DarkThreshold(frame, options_);
    if (!(i.maxCoeff() < ClipThreshold(frame, options_))) {
      ++saturated_;
      continue;
    }
    const Incident incident = IncidentAt(input_.rig.lights[k], *x_mm);
    if (!(incident.e_rgb.minCoeff() > 0.0)) {
      continue;  // behind the LED
    }
    const Eigen::Vector3d scaled = i.cast<double>().cwiseQuotient(incident.e_rgb);  // (2)
    const double luminance = scaled.dot(LuminanceWeights());
    brightest = std::max(brightest, luminance);
    l_.row(count_) = incident.l.transpose();
    rhs_.row(count_) << scaled.transpose(), luminance;
    e_.row(count_) = incident.e_rgb.transpose();
    frames_[static_cast<size_t>(count_)] = static_cast<int>(k);
    ++count_;
  }
  const double shadow = options_.shadow_level * brightest;
  const int unsaturated = count_;
  count_ = 0;
  for (int k = 0; k < unsaturated; ++k) {
    if (rhs_(k, 3) > shadow) {
      l_.row(count_) = l_.row(k).eval();
      rhs_.row(count_) = rhs_.row(k).eval();
      e_.row(count_) = e_.row(k).eval();
      frames_[static_cast<size_t>(count_)] = frames_[static_cast<size_t>(k)];
      ++count_;
    }
  }
}

Reason PixelSystem::SampleReason() const {
  if (!bright_) {
    return Reason::kDark;
  }
  if (count_ >= 3) {
    return Reason::kSolved;
  }
  return saturated_ > 0 ? Reason::kSaturated : Reason::kTooFewSamples;
}

}  // namespace sateen
