#include "scanner/sessions/session_layout.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/sha256.h"
#include "imaging/raw.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr double kOtherLens = 0.1;       // share of the focal length
constexpr double kOtherPlaceMm = 150.0;  // no ruler is so wrong

Status ReadRigInto(const fs::path& path, const std::optional<std::string>& recorded_sha256,
                   ReadPlan& plan) {
  const Result<std::string> hash = Sha256OfFile(path);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  if (recorded_sha256 && *recorded_sha256 != *hash) {
    return Fail(ErrorCode::kBadData,
                "{}: its SHA-256 is {} but the session recorded {}: the rig has changed since the "
                "capture; restore it, or give the rig to use with --rig",
                path.string(), *hash, *recorded_sha256);
  }
  Result<Rig> rig = ReadRig(path);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  plan.sha256_of_input[path.string()] = *hash;
  plan.rig = *std::move(rig);
  return {};
}

std::string NamesOf(const Lights& lights) {
  std::string names;
  for (const Light& light : lights) {
    names += (names.empty() ? "" : ", ") + light.name;
  }
  return names;
}

// Adds a file to its light. Fails unless the light's files differ in exposure alone: only several
// exposures of one picture may be merged.
Status AddToLight(const FrameFile& file, const SessionFrame& frame, const Session& session,
                  const std::string& where, const fs::path& dir, LightFiles& files) {
  for (const FrameFile& other : files) {
    const std::string both =
        fmt::format("{}: frames {} and {} are both of light '{}'", where,
                    other.path.lexically_relative(dir).string(), frame.file, frame.light);
    if (session.kind == SessionKind::kChart) {
      return Fail(
          ErrorCode::kBadData,
          "{}; need one frame for each light; the series of a chart is for sateen calibrate "
          "response",
          both);
    }
    if (other.exposure == file.exposure) {
      return Fail(ErrorCode::kBadData,
                  "{}, with one exposure; need one frame for each light, or several that differ in "
                  "exposure_s",
                  both);
    }
    if (other.shift_px != file.shift_px) {
      return Fail(ErrorCode::kBadData,
                  "{}, with another shift_px; need one for all that are merged: capture them again",
                  both);
    }
  }
  const auto shorter = std::ranges::find_if(
      files, [&](const FrameFile& other) { return other.exposure < file.exposure; });
  files.insert(shorter, file);
  return {};
}

// Fails if frames of one light differ in aperture or ISO: then the picture, or the sensor's noise,
// is another one.
Status CheckSettings(const Session& session, const std::string& where) {
  std::map<std::string, const SessionFrame*> first;
  for (const SessionFrame& frame : session.frames) {
    if (frame.role != FrameRole::kLit || session.kind == SessionKind::kChart) {
      continue;
    }
    const SessionFrame& other = *first.emplace(frame.light, &frame).first->second;
    if (other.f_number != frame.f_number || other.iso != frame.iso) {
      return Fail(ErrorCode::kBadData,
                  "{}: frames {} and {} of light '{}' differ in aperture or ISO; to be merged they "
                  "may differ in exposure_s alone",
                  where, other.file, frame.file, frame.light);
    }
  }
  return {};
}

FrameFile FileOf(const fs::path& dir, const SessionFrame& frame, const ReadPlan& plan) {
  return {dir / frame.file, frame.Exposure(), frame.sha256, plan.rig.response,
          frame.shift_px.value_or(Eigen::Vector2d::Zero())};
}

// Puts each frame at the place of its light.
Status AssignFrames(const fs::path& dir, ReadPlan& plan) {
  const std::string where = (dir / "session.json").string();
  plan.lit.resize(plan.rig.lights.size());
  for (const SessionFrame& frame : plan.session->frames) {
    FrameFile file = FileOf(dir, frame, plan);
    if (frame.role == FrameRole::kDark) {
      plan.dark.push_back(std::move(file));
      continue;
    }
    const Lights& lights = plan.rig.lights;
    const auto light = std::find_if(lights.begin(), lights.end(),
                                    [&](const Light& l) { return l.name == frame.light; });
    if (light == lights.end()) {
      return Fail(ErrorCode::kBadData,
                  "{}: frame {} is of light '{}', which is not in the rig; its lights are {}",
                  where, frame.file, frame.light,
                  lights.empty() ? "none: give it rough positions, measured with a ruler"
                                 : NamesOf(lights));
    }
    LightFiles& files = plan.lit[static_cast<size_t>(light - lights.begin())];
    if (Status status = AddToLight(file, frame, *plan.session, where, dir, files); !status) {
      return status;
    }
  }
  return CheckSettings(*plan.session, where);
}

// Returns a light's frame and its repeat, which ReadSession() leaves out; nothing if they are not
// camera RAW of one exposure.
Result<std::optional<RepeatedLight>> FindRepeat(const fs::path& dir, const ReadPlan& plan) {
  const Result<Session> record = ReadSessionRecord(dir);
  if (!record) {
    return tl::unexpected(record.error());
  }
  for (const SessionFrame& frame : record->frames) {
    if (frame.role != FrameRole::kRepeat || !IsRawName(frame.file)) {
      continue;
    }
    const auto first = std::ranges::find_if(record->frames, [&](const SessionFrame& other) {
      return other.role == FrameRole::kLit && other.light == frame.light &&
             other.exposure_s == frame.exposure_s && other.f_number == frame.f_number &&
             other.iso == frame.iso && IsRawName(other.file);
    });
    if (first != record->frames.end()) {
      return RepeatedLight{.first = FileOf(dir, *first, plan), .again = FileOf(dir, frame, plan)};
    }
  }
  return std::nullopt;
}

// Returns the differences that make it another rig. A calibrated rig differs from the rig of the
// capture only by what a ruler is wrong by.
std::vector<std::string> DifferencesOf(const Rig& given, const Rig& own) {
  std::vector<std::string> differences;
  if (given.camera && own.camera && given.camera->model != own.camera->model) {
    differences.push_back(fmt::format("its camera is '{}', the session's is '{}'",
                                      given.camera->model, own.camera->model));
  }
  if (given.camera && own.camera && given.camera->size_px == own.camera->size_px &&
      std::abs(given.camera->fx / own.camera->fx - 1.0) > kOtherLens) {
    differences.push_back(fmt::format("its focal length is {:.0f} px, the session's is {:.0f} px",
                                      given.camera->fx, own.camera->fx));
  }
  for (const Light& light : given.lights) {
    const auto other = std::ranges::find(own.lights, light.name, &Light::name);
    const bool is_distant = light.model == LightModel::kDistant;
    if (other != own.lights.end() && is_distant != (other->model == LightModel::kDistant)) {
      differences.push_back(fmt::format("its light '{}' is {}distant, the session's is {}",
                                        light.name, is_distant ? "" : "not ",
                                        is_distant ? "near" : "distant"));
      break;
    }
    if (other != own.lights.end() && !is_distant &&
        (light.position_mm - other->position_mm).norm() > kOtherPlaceMm) {
      differences.push_back(fmt::format("its light '{}' is {:.0f} mm from the session's",
                                        light.name,
                                        (light.position_mm - other->position_mm).norm()));
      break;  // one says it all
    }
  }
  return differences;
}

void WarnOfOtherRig(const fs::path& dir, const fs::path& rig_file, ReadPlan& plan) {
  const Result<Rig> own = ReadRig(dir / plan.session->rig);
  if (!own) {
    return;  // the one that is given stands in for it
  }
  for (const std::string& difference : DifferencesOf(plan.rig, *own)) {
    plan.warnings.push_back(fmt::format("{}: {}; is it the rig that {} was captured with?",
                                        rig_file.string(), difference, dir.string()));
  }
}

}  // namespace

Result<ReadPlan> PlanSessionRig(const fs::path& dir, const ReadDatasetOptions& options) {
  ReadPlan plan;
  plan.layout = "session";
  const Result<Session> session = ReadSession(dir);
  if (!session) {
    return tl::unexpected(session.error());
  }
  plan.session = *session;
  const fs::path path = dir / "session.json";
  const Result<std::string> hash = Sha256OfFile(path);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  plan.sha256_of_input[path.string()] = *hash;
  const Status rig = options.rig_file ? ReadRigInto(*options.rig_file, std::nullopt, plan)
                                      : ReadRigInto(dir / session->rig, session->rig_sha256, plan);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  return plan;
}

Result<ReadPlan> PlanSession(const fs::path& dir, const ReadDatasetOptions& options) {
  Result<ReadPlan> plan = PlanSessionRig(dir, options);
  if (!plan) {
    return plan;
  }
  if (const Status status = AssignFrames(dir, *plan); !status) {
    return tl::unexpected(status.error());
  }
  Result<std::optional<RepeatedLight>> repeated = FindRepeat(dir, *plan);
  if (!repeated) {
    return tl::unexpected(repeated.error());
  }
  plan->repeated = *std::move(repeated);
  if (options.rig_file) {
    WarnOfOtherRig(dir, *options.rig_file, *plan);
  }
  if (plan->session->mask) {
    plan->mask = dir / *plan->session->mask;
  }
  plan->truth = FindSessionTruth(dir);
  return plan;
}

}  // namespace sateen
