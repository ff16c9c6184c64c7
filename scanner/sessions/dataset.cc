#include "scanner/sessions/dataset.h"

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "core/sha256.h"
#include "imaging/raw.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/frames/frame_loader.h"
#include "scanner/sessions/lp_layout.h"
#include "scanner/sessions/public_layouts.h"
#include "scanner/sessions/read_plan.h"
#include "scanner/sessions/session_layout.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

Status CheckKind(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    return Fail(ErrorCode::kIo, "{}: {}; need a folder or an .lp file", path.string(),
                error.message());
  }
  if (!fs::is_directory(status) && LowerCase(path.extension().string()) != ".lp") {
    return Fail(ErrorCode::kBadData,
                "{}: is neither a folder nor an .lp file; give the folder of the session",
                path.string());
  }
  return {};
}

Result<ReadPlan> PlanByPath(const fs::path& path, const ReadDatasetOptions& options) {
  if (const Status status = CheckKind(path); !status) {
    return tl::unexpected(status.error());
  }
  const bool find_mask = !options.mask_file.has_value();
  const auto with_companions = [&](const fs::path& dir, const fs::path& shared_dir) {
    return [=](ReadPlan plan) -> Result<ReadPlan> {
      return FindCompanions(dir, shared_dir, find_mask, plan).map([&] { return std::move(plan); });
    };
  };
  if (LowerCase(path.extension().string()) == ".lp" && !fs::is_directory(path)) {
    const fs::path dir = path.has_parent_path() ? path.parent_path() : fs::path(".");
    return PlanLp(path).and_then(with_companions(dir, dir));
  }
  if (Exists(path / "session.json") || Exists(path / "journal.jsonl")) {
    return PlanSession(path, options);
  }
  if (options.lights_unknown) {
    return PlanPhotographs(path);
  }
  if (Exists(path / "light_directions.txt")) {
    return PlanDiligent(path).and_then(with_companions(path, path));
  }
  for (const fs::path& dir : {path, ParentOf(path)}) {
    if (Exists(dir / "lights.txt")) {
      return PlanLightsFolder(path, dir / "lights.txt").and_then(with_companions(path, dir));
    }
  }
  if (options.rig_file) {
    return PlanPhotographs(path);
  }
  return Fail(
      ErrorCode::kBadData,
      "{}: found {}, and no session.json, light_directions.txt or lights.txt, nor a "
      "lights.txt one folder up; need one of them, the path of an .lp file, or --rig with a "
      "light for each photograph",
      path.string(), DescribeFolder(path));
}

// Reads the rig that the caller gives instead of the lights of a public layout.
Status ReplaceRig(const fs::path& rig_file, ReadPlan& plan) {
  Result<Rig> rig = ReadRig(rig_file);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  const Result<std::string> hash = Sha256OfFile(rig_file);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  if (rig->lights.size() != plan.lit.size()) {
    return Fail(ErrorCode::kBadData,
                "{}: has {} lights but there are {} frames; need one light per frame",
                rig_file.string(), rig->lights.size(), plan.lit.size());
  }
  plan.sha256_of_input[rig_file.string()] = *hash;
  plan.rig = *std::move(rig);
  for (LightFiles& files : plan.lit) {
    for (FrameFile& frame : files) {
      frame.response = plan.rig.response;
    }
  }
  for (FrameFile& frame : plan.dark) {
    frame.response = plan.rig.response;
  }
  return {};
}

Result<ReadPlan> Plan(const fs::path& path, const ReadDatasetOptions& options) {
  Result<ReadPlan> plan = PlanByPath(path, options);
  if (!plan) {
    return plan;
  }
  if (options.rig_file && !plan->session) {
    if (const Status status = ReplaceRig(*options.rig_file, *plan); !status) {
      return tl::unexpected(status.error());
    }
  }
  if (options.mask_file) {
    plan->mask = options.mask_file;
  }
  if (options.truth_dir) {
    plan->truth = FindSessionTruth(*options.truth_dir);
    if (!plan->truth) {
      return Fail(ErrorCode::kIo,
                  "{}: has no truth/normal.exr; give the folder of a simulated session",
                  options.truth_dir->string());
    }
  }
  return plan;
}

// Keeps the lights that are asked for, in the order asked.
Status SelectLights(const std::vector<int>& wanted, ReadPlan& plan) {
  if (wanted.empty()) {
    return {};
  }
  const int count = static_cast<int>(plan.lit.size());
  Lights lights;
  std::vector<LightFiles> lit;
  std::set<int> seen;
  for (const int k : wanted) {
    if (k < 0 || k >= count) {
      return Fail(ErrorCode::kInvalidArgument, "light {} does not exist; there are 0 to {}", k,
                  count - 1);
    }
    if (!seen.insert(k).second) {
      return Fail(ErrorCode::kInvalidArgument,
                  "light {} is named twice; name each of 0 to {} at most once", k, count - 1);
    }
    lights.push_back(plan.rig.lights[static_cast<size_t>(k)]);
    lit.push_back(plan.lit[static_cast<size_t>(k)]);
  }
  plan.rig.lights = std::move(lights);
  plan.lit = std::move(lit);
  return {};
}

// Fails unless every light has a frame and no file serves two of them.
Status CheckLitFrames(const fs::path& path, const ReadPlan& plan) {
  std::set<fs::path> seen;
  for (size_t k = 0; k < plan.lit.size(); ++k) {
    if (plan.lit[k].empty()) {
      return Fail(ErrorCode::kBadData,
                  "{}: no lit frame of light '{}'; capture it again, or leave this light out with "
                  "--lights",
                  path.string(), plan.rig.lights[k].name);
    }
    for (const FrameFile& frame : plan.lit[k]) {
      if (!seen.insert(frame.path.lexically_normal()).second) {
        return Fail(
            ErrorCode::kBadData,
            "{}: is named for two lights or exposures, the second of light '{}'; need a file "
            "for each",
            frame.path.string(), plan.rig.lights[k].name);
      }
    }
  }
  return {};
}

Status ReadMaskInto(const ReadPlan& plan, Dataset& dataset) {
  const std::string name = plan.mask->string();
  if (plan.mask_is_shared) {
    const PictureLimit any_size{.max_pixels = std::numeric_limits<int64_t>::max()};
    const Result<ImageSize> size = ReadPhotoSize(*plan.mask, any_size);
    if (!size) {
      return tl::unexpected(size.error());
    }
    if (const Status same = CheckSize(name, *size, dataset.Size()); !same) {
      dataset.warnings.push_back("the mask is not used: " + same.error().message);
      return {};
    }
  }
  Result<Mask> mask = ReadMask(*plan.mask, {.size_px = dataset.Size()});
  if (!mask) {
    return tl::unexpected(mask.error());
  }
  if (std::all_of(mask->pixels.begin(), mask->pixels.end(), [](uint8_t m) { return m == 0; })) {
    return Fail(ErrorCode::kBadData,
                "{}: the mask is empty; need at least one pixel of half of full scale", name);
  }
  const Result<std::string> hash = Sha256OfFile(*plan.mask);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  dataset.sha256_of_input[name] = *hash;
  dataset.mask = *std::move(mask);
  return {};
}

void WarnOfSrgb(int srgb_count, Dataset& dataset) {
  if (srgb_count > 0) {
    dataset.warnings.push_back(fmt::format(
        "{} of {} frames are sRGB files and were linearised: precision of 8 bits, where a camera "
        "may have changed tone and colour; use RAW or linear files to measure",
        srgb_count, dataset.stack.size()));
  }
}

Status CheckCamera(const Dataset& dataset) {
  const ImageSize size = dataset.Size();
  if (dataset.rig.camera && dataset.rig.camera->size_px != size) {
    const ImageSize camera = dataset.rig.camera->size_px;
    return Fail(ErrorCode::kBadData,
                "{}: is {} x {} px but the rig's camera has {} x {} px; need the camera's size",
                dataset.FirstName(), size.width, size.height, camera.width, camera.height);
  }
  return {};
}

// Bounds the first frame by `max_pixels`, and all by its size.
Status LimitFrames(std::optional<int64_t> max_pixels, ReadPlan& plan) {
  const FrameFile& first = plan.lit.front().front();
  const PictureLimit limit{.max_pixels = max_pixels};
  const Result<ImageSize> size_px =
      IsRawName(first.path) ? ReadRawSize(first.path, limit) : ReadPhotoSize(first.path, limit);
  if (!size_px) {
    return tl::unexpected(size_px.error());
  }
  const auto limit_to_size = [&](FrameFile& file) { file.limit.size_px = *size_px; };
  for (LightFiles& files : plan.lit) {
    std::ranges::for_each(files, limit_to_size);
  }
  std::ranges::for_each(plan.dark, limit_to_size);
  if (plan.repeated) {
    limit_to_size(plan.repeated->first);
    limit_to_size(plan.repeated->again);
  }
  return {};
}

// Adds mask and truth, which must fit the frames.
Status AddCompanions(const ReadPlan& plan, Dataset& dataset) {
  if (plan.mask) {
    if (Status status = ReadMaskInto(plan, dataset); !status) {
      return status;
    }
  }
  if (plan.truth) {
    Result<Truth> truth = ReadTruth(*plan.truth, dataset.Size(), dataset.sha256_of_input);
    if (!truth) {
      return tl::unexpected(truth.error());
    }
    dataset.truth = *std::move(truth);
  }
  return {};
}

// Reads the frames as colours or as mosaics.
Status ReadFrames(const ReadPlan& plan, const ReadDatasetOptions& options, const Task& task,
                  Dataset& dataset) {
  const std::optional<std::string> why_not = WhyNoMosaics(plan);
  if (options.domain != Domain::kRgb && !why_not) {
    Result<std::optional<SensorNoise>> noise;
    if (options.by_noise) {
      noise = FindSensorNoise(plan, task);
    }
    if (!noise) {
      // No frame that is solved depends on it.
      dataset.warnings.push_back("the noise cannot be measured from the repeat: " +
                                 noise.error().message);
      noise = std::nullopt;
    }
    return LoadMosaics(plan, *noise, options.scratch_dir, task).map([&](LoadedMosaics mosaics) {
      dataset.sha256_of_input = mosaics.sha256_of_input;
      dataset.mosaics = std::move(mosaics);
    });
  }
  if (options.domain == Domain::kRaw) {
    return Fail(ErrorCode::kBadData, "{}: cannot be solved from the mosaics: {}",
                plan.lit[0][0].path.string(), *why_not);
  }
  if (options.domain == Domain::kAuto) {
    dataset.why_no_mosaics = *why_not;
  }
  return LoadFrames(plan.lit, plan.dark, options.encoding, task).map([&](LoadedFrames frames) {
    dataset.stack = std::move(frames.stack);
    dataset.sha256_of_input = std::move(frames.sha256_of_input);
    WarnOfSrgb(frames.srgb_count, dataset);
  });
}

}  // namespace

Result<Dataset> ReadDataset(const fs::path& path, const ReadDatasetOptions& options,
                            const Task& task) {
  Result<ReadPlan> plan = Plan(path, options);
  if (!plan) {
    return tl::unexpected(plan.error());
  }
  if (const Status status = SelectLights(options.lights, *plan); !status) {
    return tl::unexpected(status.error());
  }
  if (const Status status = CheckLitFrames(path, *plan).and_then([&] {
        return LimitFrames(options.max_pixels, *plan);
      });
      !status) {
    return tl::unexpected(status.error());
  }
  Dataset dataset;
  if (const Status status = ReadFrames(*plan, options, task, dataset); !status) {
    return tl::unexpected(status.error());
  }
  dataset.layout = plan->layout;
  dataset.rig = std::move(plan->rig);
  dataset.session = std::move(plan->session);
  dataset.warnings.insert(dataset.warnings.begin(), plan->warnings.begin(), plan->warnings.end());
  dataset.sha256_of_input.merge(plan->sha256_of_input);
  if (const Status status = CheckCamera(dataset); !status) {
    return tl::unexpected(status.error());
  }
  if (const Status status = AddCompanions(*plan, dataset); !status) {
    return tl::unexpected(status.error());
  }
  return dataset;
}

}  // namespace sateen
