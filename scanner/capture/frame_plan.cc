#include "scanner/capture/frame_plan.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/check.h"
#include "scanner/sessions/files/folder_listing.h"

namespace sateen {
namespace {

std::string SafeName(std::string name) {
  for (char& c : name) {
    const bool is_safe = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                         (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
    c = is_safe ? c : '_';
  }
  return name;
}

}  // namespace

FramePlan PlanOf(const Rig& rig, const std::vector<double>& exposures_s) {
  SATEEN_CHECK(!rig.lights.empty() && !exposures_s.empty());
  const SessionFrame dark = {.role = FrameRole::kDark, .exposure_s = exposures_s.back()};
  FramePlan plan = {dark};
  for (const Light& light : rig.lights) {
    for (const double exposure_s : exposures_s) {
      plan.push_back({.role = FrameRole::kLit, .light = light.name, .exposure_s = exposure_s});
    }
  }
  plan.push_back({.role = FrameRole::kRepeat,
                  .light = rig.lights.front().name,
                  .exposure_s = exposures_s.front()});
  plan.push_back(dark);
  return plan;
}

bool IsPlanOf(const Rig& rig, const FramePlan& plan) {
  std::vector<double> exposures_s;
  for (const SessionFrame& frame : plan) {
    if (frame.role == FrameRole::kLit && !rig.lights.empty() &&
        frame.light == rig.lights.front().name) {
      exposures_s.push_back(*frame.exposure_s);
    }
  }
  return !exposures_s.empty() &&
         std::ranges::equal(plan, PlanOf(rig, exposures_s), [](const auto& a, const auto& b) {
           return a.role == b.role && a.light == b.light && a.exposure_s == b.exposure_s;
         });
}

std::optional<std::size_t> LightOf(const Rig& rig, const SessionFrame& planned) {
  const auto light = std::ranges::find(rig.lights, planned.light, &Light::name);
  return light == rig.lights.end()
             ? std::nullopt
             : std::optional(static_cast<std::size_t>(light - rig.lights.begin()));
}

bool IsFirstExposure(const FramePlan& plan, std::size_t frame) {
  return frame == 0 || plan[frame].role != FrameRole::kLit ||
         plan[frame - 1].light != plan[frame].light;
}

std::string NameOf(const SessionFrame& planned) {
  return planned.role == FrameRole::kDark  ? "dark"
         : planned.role == FrameRole::kLit ? planned.light
                                           : planned.light + " again";
}

std::string FileNameOf(std::size_t frame, const SessionFrame& planned,
                       const std::filesystem::path& delivered) {
  const std::string name = planned.role == FrameRole::kDark ? "dark" : SafeName(planned.light);
  return fmt::format("frames/{:02}-{}{}{}", frame, name,
                     planned.role == FrameRole::kRepeat ? "-again" : "",
                     LowerCase(delivered.extension().string()));
}

}  // namespace sateen
