#include "scanner/checks/frame_compare.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "rig/projection.h"
#include "scanner/checks/light_patterns.h"
#include "scanner/checks/shade_check.h"

namespace sateen {
namespace {

bool IsFar(const Shift& shift, const FrameCheckOptions& options) {
  return IsSignificant(shift) && shift.px.norm() > options.max_shift_px;
}

// Returns "from the frame of light 'b' on" or "in the frames of lights 'b', 'c'".
std::string WhichFrames(const Rig& rig, const std::vector<Shift>& shifts, size_t first,
                        const FrameCheckOptions& options) {
  const size_t repeat = shifts.size() - 1;
  const std::string& first_name = rig.lights[0].name;
  if (first == repeat) {
    return fmt::format("in the second frame of light '{}', the last", first_name);
  }
  const bool stays = std::all_of(shifts.begin() + static_cast<std::ptrdiff_t>(first), shifts.end(),
                                 [&](const Shift& shift) { return IsFar(shift, options); });
  if (stays) {
    return fmt::format("from the frame of light '{}' on", rig.lights[first].name);
  }
  std::string names;
  for (size_t k = first; k < repeat; ++k) {
    if (IsFar(shifts[k], options)) {
      names += fmt::format("{}'{}'", names.empty() ? "" : ", ", rig.lights[k].name);
    }
  }
  return "in the frames of lights " + names;
}

// Returns "at the left", "in the middle" ...
std::string WhereInPicture(const Eigen::Vector2d& place) {
  constexpr double kThird = 1.0 / 3.0;
  const std::string row = place.y() < kThird ? "top" : place.y() > 2.0 * kThird ? "bottom" : "";
  const std::string column = place.x() < kThird ? "left" : place.x() > 2.0 * kThird ? "right" : "";
  if (row.empty() && column.empty()) {
    return "in the middle";
  }
  return "at the " + row + (row.empty() || column.empty() ? "" : " ") + column;
}

CaptureFault ShadeFault(const Rig& rig, size_t light, const Shade& shade) {
  return {.kind = CaptureFaultKind::kShaded,
          .lights = {light},
          .text = fmt::format(
              "a shadow lies on the frame of light '{}', {}: {:.0f} % of the picture is {:.0f} % "
              "darker than the other frames predict; keep out of the light, and see that nothing "
              "hangs into it",
              rig.lights[light].name, WhereInPicture(shade.middle), 100.0 * shade.share,
              100.0 * shade.depth)};
}

FramesToShade BlocksOf(const Rig& rig, const BlockMeans& means,
                       const std::vector<BlockField>& signal, const std::vector<size_t>& of) {
  FramesToShade frames{.grid = means.grid};
  for (const size_t light : of) {
    frames.signal.push_back(signal[light]);
  }
  frames.light.resize(of.size());
  const Eigen::Vector3d eye_mm = rig.camera->table_from_camera.translation();
  for (int row = 0; row < means.grid.rows; ++row) {
    for (int column = 0; column < means.grid.columns; ++column) {
      const Eigen::Vector2d px = means.Center(column, row);
      const std::optional<Eigen::Vector3d> x_mm = TablePointOfPixel(*rig.camera, px.x(), px.y());
      frames.view.push_back(x_mm ? Eigen::Vector3d((eye_mm - *x_mm).normalized())
                                 : Eigen::Vector3d::UnitZ());
      for (size_t frame = 0; frame < of.size(); ++frame) {
        frames.light[frame].push_back(LightAtPixel(rig, rig.lights[of[frame]], px));
      }
    }
  }
  return frames;
}

// A light that explains all frames far better if a frame is given its direction.
struct OtherLight {
  size_t frame = 0;
  bool is_swapped = false;  // and the light's own frame has to be given this frame's
};

std::optional<OtherLight> OtherLightOf(size_t frame, const FrameCheckOptions& options,
                                       FramesToShade& frames) {
  // The option is one of squares.
  double least = std::sqrt(options.other_light_misfit) * MisfitOfLights(frames);
  std::optional<OtherLight> best;
  // Nothing may be left of the shadow then: a slope of light can also look a little like its edge.
  const auto keep_if_better = [&](const OtherLight& other) {
    const double misfit = MisfitOfLights(frames);
    if (misfit < least && !FindShades(frames, options.min_shade)[frame]) {
      least = misfit;
      best = other;
    }
  };
  const std::vector<Eigen::Vector3d> own = frames.light[frame];
  for (size_t other = 0; other < frames.light.size(); ++other) {
    if (other != frame) {
      frames.light[frame] = frames.light[other];
      keep_if_better({other, false});
      frames.light[other] = own;
      keep_if_better({other, true});
      frames.light[other] = frames.light[frame];
    }
  }
  frames.light[frame] = own;
  return best;
}

}  // namespace

CaptureFault OtherLightFault(const Rig& rig, size_t light, size_t other) {
  return {.kind = CaptureFaultKind::kOtherLight,
          .lights = {light},
          .text = fmt::format(
              "the frame of light '{}' is lit from the position of light '{}'; are they swapped? "
              "Check the channels of both ({} and {})",
              rig.lights[light].name, rig.lights[other].name, rig.lights[light].channel,
              rig.lights[other].channel)};
}

std::vector<Shift> ShiftsOf(const Rig& rig, const CaptureLooks& looks, const std::vector<bool>& on,
                            const FrameCheckOptions& options) {
  FramesToRegister input;
  std::vector<size_t> of;  // which light each frame is of
  for (size_t k = 0; k < looks.lit.size(); ++k) {
    if (on[k]) {
      input.frames.push_back(looks.lit[k].middle);
      of.push_back(k);
    }
  }
  if (!on[0]) {
    return {};
  }
  input.frames.push_back(looks.repeat.middle);
  of.push_back(0);
  const PixelPlace origin = OriginOfMiddle(looks.repeat.means.size_px, looks.repeat.middle.Size());
  input.light = [rig, of, origin](size_t frame, const Eigen::Vector2d& cell) {
    const Eigen::Vector2d px(origin.x + 2.0 * cell.x() + 0.5, origin.y + 2.0 * cell.y() + 0.5);
    return LightAtPixel(rig, rig.lights[of[frame]], px);
  };
  const std::vector<Shift> found = RegisterFrames(input, options.min_shift_peak);
  if (!std::isfinite(found.back().sd_px)) {
    return {};
  }
  std::vector<Shift> shifts(looks.lit.size() + 1);
  for (size_t frame = 0; frame + 1 < found.size(); ++frame) {
    shifts[of[frame]] = found[frame];
  }
  shifts.back() = found.back();
  return shifts;
}

std::optional<CaptureFault> MovedFault(const Rig& rig, const std::vector<Shift>& shifts,
                                       const FrameCheckOptions& options) {
  const auto first =
      std::ranges::find_if(shifts, [&](const Shift& shift) { return IsFar(shift, options); });
  if (first == shifts.end()) {
    return std::nullopt;
  }
  const Eigen::Vector2d& px = first->px;
  return CaptureFault{
      .kind = CaptureFaultKind::kMoved,
      .text = fmt::format(
          "the picture has moved by {:.1f} px ({:+.1f} right, {:+.1f} down) {}, more than {:g} px; "
          "fix camera and fabric, check the calibration, and capture every frame again",
          px.norm(), px.x(), px.y(),
          WhichFrames(rig, shifts, static_cast<size_t>(first - shifts.begin()), options),
          options.max_shift_px)};
}

std::optional<size_t> OnlyOneThatMoved(const std::vector<Shift>& shifts,
                                       const FrameCheckOptions& options) {
  const auto is_far = [&](const Shift& shift) { return IsFar(shift, options); };
  const auto first = std::ranges::find_if(shifts, is_far);
  return std::ranges::count_if(shifts, is_far) == 1 && !is_far(shifts.back())
             ? std::optional(static_cast<size_t>(first - shifts.begin()))
             : std::nullopt;
}

std::vector<CaptureFault> ShadedFaults(const Rig& rig, const CaptureLooks& looks,
                                       const std::vector<BlockField>& signal,
                                       const std::vector<bool>& on,
                                       const FrameCheckOptions& options, double min_light) {
  if (!rig.camera || !rig.camera->has_pose) {
    return {};
  }
  std::vector<size_t> of;  // which light each frame is of
  for (size_t k = 0; k < signal.size(); ++k) {
    if (on[k]) {
      of.push_back(k);
    }
  }
  FramesToShade frames = BlocksOf(rig, looks.lit[0].means, signal, of);
  const std::vector<std::optional<Shade>> shades = FindShades(frames, options.min_shade);
  std::vector<CaptureFault> faults;
  for (size_t frame = 0; frame < shades.size(); ++frame) {
    if (!shades[frame] || shades[frame]->share * shades[frame]->depth < min_light) {
      continue;
    }
    if (const std::optional<OtherLight> other = OtherLightOf(frame, options, frames)) {
      const auto [a, b] = std::minmax({of[frame], of[other->frame]});
      return other->is_swapped ? std::vector{OtherLightFault(rig, a, b), OtherLightFault(rig, b, a)}
                               : std::vector{OtherLightFault(rig, of[frame], of[other->frame])};
    }
    faults.push_back(ShadeFault(rig, of[frame], *shades[frame]));
  }
  return faults;
}

}  // namespace sateen
